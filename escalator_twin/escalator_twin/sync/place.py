"""Find where in the loop a recording begins, without slipping by a pitch."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import log

import numpy as np

from escalator_twin.errors import SynchronisationError
from escalator_twin.signals import Floats

FLOOR = 1e-3  # of variance: better agreement than this says nothing more about the place
# Smallest lead of the best place over any other pitch for it to be certain: there the residual
# variance is a fifth larger. A minute holds some 240 independent samples below 2 Hz, for which
# that is a log-likelihood of 24; a signal that repeats with every pitch leads by nothing. A shorter recording has
# to lead by more, for the same log-likelihood.
CLEAR = 0.2
CLEAR_S = 60.0
# Times by which a channel may be larger or smaller than the twin's and still agree: a spring, friction or load that is
# another by its reference size changes no channel's motion by more. Beyond, or with the other sign, it agrees as one
# sensor in twenty does: on a straight run a rising force is as straight as a falling one.
GAIN = 2.0
ODD = log(20.0)
LEAST_GAIN = 1e-6  # of what is divided by: a channel that does not move says nothing


@dataclass(frozen=True)
class Place:
    """Where the recording begins.

    Attributes
    ----------
    start_m : float
        Travel of the template at the recording's first travel, m, within one loop of travel.
    lead : float
        By how much its score exceeds the best one half a pitch or more away: the logarithm of
        the ratio of residual variances, summed over channels.
    agreement : mapping
        Squared correlation of each channel there.
    """

    start_m: float
    lead: float
    agreement: Mapping[str, float]


def clear_lead(duration_s: float) -> float:
    """Return the smallest lead by which a recording's place is certain."""
    return CLEAR * max(1.0, CLEAR_S / max(duration_s, 1.0))


def fits_of(measured: Floats, loop: Floats) -> tuple[Floats, Floats]:
    """Return how a signal agrees with a periodic template at every shift, offset free.

    Parameters
    ----------
    measured : (m,) float64
    loop : (n,) float64
        One loop of the template, on the same spacing.

    Returns
    -------
    squared : (n,) float64
        Squared correlation.
    gain : (n,) float64
        Of the signal over the template, by least squares.
    """
    n = len(loop)
    counts = np.bincount(np.arange(len(measured)) % n, minlength=n).astype(float)
    centred = measured - measured.mean()
    folded = np.zeros(n)
    np.add.at(folded, np.arange(len(measured)) % n, centred)

    def slide(kernel: Floats, values: Floats) -> Floats:
        return np.fft.irfft(np.conj(np.fft.rfft(kernel)) * np.fft.rfft(values), n)

    mean = slide(counts, loop) / len(measured)
    power = slide(counts, loop**2) - len(measured) * mean**2
    power = np.maximum(power, max(1e-12 * power.max(), np.finfo(float).tiny))
    cross = slide(folded, loop)
    total = float(centred @ centred)
    if total <= 0.0:
        return np.zeros(n), np.zeros(n)
    return np.clip(cross**2 / (power * total), 0.0, 1.0), cross / power


def score_of(squared: Floats, gain: Floats) -> Floats:
    """Return what a channel says for every shift: the log-likelihood of the residual's variance, at least none.

    The gain is free within `GAIN`. An inverted sensor, or one of another gain, still tells its place, but less.
    """
    size = np.maximum(gain, LEAST_GAIN)
    miss = np.minimum(np.abs(1.0 - np.clip(size, 1.0 / GAIN, GAIN) / size), 1.0)
    left = 1.0 - squared * (1.0 - miss**2)
    fair = np.where(gain > 0.0, -np.log(left + FLOOR), 0.0)
    odd = -np.log(1.0 - squared + FLOOR) - ODD
    return np.maximum(np.maximum(fair, odd), 0.0)


def find_place(
    measured: Mapping[str, Floats], loop: Mapping[str, Floats], spacing_m: float, pitch_m: float
) -> Place:
    """Find the shift at which all channels together agree best.

    The score is the sum over channels of the log-likelihood of the residual's variance, each
    channel with its own unknown gain and offset, so that one faulty channel cannot decide: see
    `score_of`.

    Parameters
    ----------
    measured : mapping of channel to (m,) float64
        On an even grid of travel.
    loop : mapping of channel to (n,) float64
        One loop of the simulated signals on the same spacing.
    spacing_m, pitch_m : float

    Raises
    ------
    SynchronisationError
        Where no channel is common to both.
    """
    common = [c for c in measured if c in loop]
    if not common:
        raise SynchronisationError('no channel tells the place in the loop')
    fits = {c: fits_of(measured[c], loop[c]) for c in common}
    score = np.sum([score_of(*fits[c]) for c in common], axis=0)
    best = int(np.argmax(score))
    n = len(score)
    away = np.abs((np.arange(n) - best + n // 2) % n - n // 2) * spacing_m >= 0.5 * pitch_m
    lead = float(score[best] - score[away].max()) if away.any() else np.inf
    return Place(best * spacing_m, lead, {c: float(fits[c][0][best]) for c in common})
