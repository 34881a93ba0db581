"""Real speed of a run from the signals that the chain's pitch makes periodic."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.fft import next_fast_len, rfft
from scipy.ndimage import median_filter

from escalator_twin.errors import SynchronisationError
from escalator_twin.metrics.filters import bridge, highpass, Mask
from escalator_twin.signals import Floats
from escalator_twin.sync.loops import follow_loops
from escalator_twin.sync.phase import follow_phase

LEAST_PITCHES = 6.0  # that a recording must pass
N_HARMONICS = 4  # of the pitch frequency that are looked at
LEAST_LEAD = 1.5  # natural logarithm of power, best speed over the next best
# the same over the noise, all multiples together: for one signal and for each further one,
LEAST_SCORE, LEAST_SCORE_MORE = 9.0, 5.0
LEAST_EXPLAINED = 0.6  # or this share of the variance above half the pitch frequency
NOISE_WITHIN = 0.5  # cycles per pitch about a multiple: where its noise is taken from
# the line itself fills most of that in a short recording: a low quantile leaves it out
NOISE_QUANTILE = 0.15
BEYOND = 0.005  # searched beyond the largest speed error
SPIKE = 8.0  # robust deviations from the running median
SPIKE_FLOOR = 0.02  # of the standard deviation: smaller spikes do no harm
SPIKE_WIDTH = 5  # samples of the running median
PADDING = 8  # of the spectrum: points per bin


@dataclass(frozen=True)
class SpeedEstimate:
    """Mean speed of a run and the travel at each sample.

    Attributes
    ----------
    value : float
        Mean speed over the samples given, m/s, positive.
    low, high : float
        Its 95 % interval, m/s.
    travel_m : (n,) float64
        Travel since the first sample, m; beyond ``value`` times time it holds the slow wander.
    lead : float
        By how much the best speed beats the next best one, natural logarithm of power.
    """

    value: float
    low: float
    high: float
    travel_m: Floats
    lead: float


def estimate_speed(
    time_s: ArrayLike,
    values: ArrayLike,
    pitch_m: float,
    set_speed_m_s: float,
    speed_error: float = 0.07,
    wander: float = 0.002,
    loop_m: float | None = None,
) -> SpeedEstimate:
    """Find the mean speed from signals that repeat with every pitch: v = f pitch.

    Cano-Moreno et al., eq. 4, taken further: the spectra at the pitch frequency and its
    multiples give a first guess; then the phase of these orders is followed through the
    recording and its smooth course gives travel. That serves signals that are periodic in the
    pitch all along, as the tensioner's. Where the phase changes with the place in the loop,
    as that of a sensor that rides on the chain, stretches that come again one loop
    later are used instead, if ``loop_m`` is given and enough comes again; if not, the interval
    is as wide as an unknown phase at both ends makes it.

    Parameters
    ----------
    time_s : (n,) float64
        Increasing, even or not, s.
    values : (n,) or (n, k) float64
        One or several signals, any unit; NaN where there is no sample.
    pitch_m : float
        Chain pitch, m.
    set_speed_m_s : float
        Speed set, > 0, m/s.
    speed_error : float
        Largest relative difference of real and set speed.
    wander : float
        Largest relative wander of the speed about its mean, slower than 30 s.
    loop_m : float, optional
        Travel after which everything repeats: links times pitch, m.

    Raises
    ------
    SynchronisationError
        Where the recording is too short or shows no clear pitch frequency.
    """
    time, columns, valid = _clean(time_s, values)
    start = float(time[0]) if len(time) else 0.0
    span = float(time[-1]) - start if len(time) else 0.0
    needed = LEAST_PITCHES * pitch_m / set_speed_m_s
    if len(time) < 20 or span < needed or not valid.any(axis=0).all():
        raise SynchronisationError(
            f'speed: expected at least {needed:.1f} s of samples, {LEAST_PITCHES:.0f} pitches, '
            f'found {span:.1f} s with {int(valid.all(axis=1).sum())} valid samples'
        )
    set_hz, reach = set_speed_m_s / pitch_m, speed_error + BEYOND
    first, lead = _first_guess(time, columns, valid, set_hz, reach)
    course = None
    if lead >= LEAST_LEAD:
        course = follow_phase(time - start, columns, valid, first, N_HARMONICS, wander)
    if loop_m is not None and (course is None or not course.clear):
        # a pitch frequency leaves half a cycle open, over a loop
        around = (set_hz, reach) if course is None else (first, 0.5 * pitch_m / loop_m)
        loops = follow_loops(time - start, columns, valid, loop_m / pitch_m, wander, around)
        course = loops or course
    if course is None:
        raise SynchronisationError(
            f'speed: no clear pitch frequency within {speed_error:.0%} of {set_hz:.3f} Hz: the '
            f'best is only {np.exp(lead):.1f} times as strong as the next, expected '
            f'{np.exp(LEAST_LEAD):.1f}'
        )
    every = np.asarray(time_s, dtype=np.float64) - start
    low, high = course.mean_hz - course.half_width_hz, course.mean_hz + course.half_width_hz
    travel = pitch_m * (course.at(every) - course.at(every[:1]))
    return SpeedEstimate(pitch_m * course.mean_hz, pitch_m * low, pitch_m * high, travel, lead)


def _clean(time_s: ArrayLike, values: ArrayLike) -> tuple[Floats, Floats, Mask]:
    """Return increasing times (n,), signals (n, k) and which of their samples to trust."""
    time = np.asarray(time_s, dtype=np.float64)
    columns = np.asarray(values, dtype=np.float64)
    if columns.ndim == 1:
        columns = columns[:, None]
    if time.ndim != 1 or columns.shape[0] != len(time):
        raise SynchronisationError(
            f'speed: expected one value per time, found {columns.shape[0]} and {len(time)}'
        )
    if len(time) < 2:
        return time, columns, np.isfinite(columns)
    rising = np.isfinite(time)
    rising &= time > np.concatenate([[-np.inf], np.maximum.accumulate(time)[:-1]])
    time, columns = time[rising], columns[rising]
    valid = np.isfinite(columns)
    for k in range(columns.shape[1]):
        valid[:, k] &= ~_spikes(bridge(columns[:, k], valid[:, k]))
    return time, columns, valid


def _spikes(values: Floats) -> Mask:
    """Return which of ``values`` (n,) stand off their neighbours."""
    off = np.abs(values - median_filter(values, SPIKE_WIDTH, mode='nearest'))
    robust = SPIKE * 1.4826 * float(np.median(off))
    middle = np.percentile(values, [16.0, 84.0])
    return np.asarray(off > max(robust, SPIKE_FLOOR * float(middle[1] - middle[0])))


def _first_guess(
    time: Floats, columns: Floats, valid: Mask, set_hz: float, reach: float
) -> tuple[float, float]:
    """Return the pitch frequency whose multiples are strongest, Hz, and its lead.

    The score of a frequency is the sum, over signals and multiples, of the logarithm of the
    spectrum's power there over the noise about it. The lead is over the best frequency
    outside the main lobe of the Hann window; 0 where there is nothing but noise.
    """
    span = float(time[-1] - time[0])
    rate = (len(time) - 1) / span
    n_candidates = int(40.0 * reach * set_hz * span) + 9
    candidates = set_hz * np.linspace(1.0 - reach, 1.0 + reach, n_candidates)
    multiples = np.arange(1, max(1, min(N_HARMONICS, int(0.4 * rate / candidates[-1]))) + 1)
    rows, real = _even_rows(time, columns, valid, 0.5 * set_hz)
    window = np.hanning(rows.shape[1])
    n = next_fast_len(PADDING * rows.shape[1], real=True)
    bins = np.arange(n // 2 + 1) * rate / n
    score = np.zeros(n_candidates)
    for row in rows:
        power = np.abs(rfft(row * window, n)) ** 2
        for multiple in multiples:
            around = np.abs(bins - multiple * set_hz) < NOISE_WITHIN * set_hz
            # of the exponential distribution that noise power has
            noise = float(np.quantile(power[around], NOISE_QUANTILE)) / -np.log1p(-NOISE_QUANTILE)
            score += np.log1p(np.interp(multiple * candidates, bins, power) / max(noise, 1e-300))
    best = int(np.argmax(score))
    found = float(candidates[best])
    lines: Floats = found / rate * multiples.astype(np.float64)
    least = LEAST_SCORE + LEAST_SCORE_MORE * (len(rows) - 1)
    if score[best] < least and _explained(rows, real, lines) < LEAST_EXPLAINED:
        return found, 0.0
    rivals = score[np.abs(candidates - found) > 2.0 / span]
    return found, float(score[best] - rivals.max()) if len(rivals) else float(score[best])


def _even_rows(time: Floats, columns: Floats, valid: Mask, from_hz: float) -> tuple[Floats, Mask]:
    """Return the signals (k, n) above ``from_hz`` on an even grid, 0 where there are gaps."""
    rate = (len(time) - 1) / float(time[-1] - time[0])
    grid = time[0] + np.arange(len(time)) / rate
    rows, real = np.zeros((2, columns.shape[1], len(time)))
    for k in range(columns.shape[1]):
        whole = bridge(columns[:, k], valid[:, k])
        even = highpass(np.interp(grid, time, whole - whole.mean()), from_hz, rate)
        real[k] = np.interp(grid, time, valid[:, k].astype(np.float64)) > 0.5
        rows[k] = np.where(real[k], even, 0.0)
    return rows, real > 0.5


def _explained(rows: Floats, real: Mask, lines: Floats) -> float:
    """Return the largest share of a row's variance that steady lines, cycles per sample, make."""
    angles = 2.0 * np.pi * np.outer(np.arange(rows.shape[1]), lines)
    design = np.hstack([np.cos(angles), np.sin(angles)])
    shares = []
    for row, here in zip(rows, real, strict=True):
        power = float(row @ row)
        if power > 0.0:
            found = np.linalg.lstsq(design[here], row[here], rcond=None)[0]
            shares.append(1.0 - float(np.sum((row[here] - design[here] @ found) ** 2)) / power)
    return max(shares, default=0.0)
