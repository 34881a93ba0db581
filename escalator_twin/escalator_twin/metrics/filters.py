"""Zero-phase filters on uniform grids, and bridges over samples that are missing."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from escalator_twin.signals import Floats

Mask = NDArray[np.bool_]

ORDER = 4  # Butterworth, as Cano-Moreno et al., section V
# a large slow signal lies just below what the high-pass is to keep
HIGHPASS_ORDER = 8
# of a mean or an amplitude: below this a variation is rounding, not signal
ROUNDING = 1e-12
PIECE = 1 << 16  # samples filtered at a time: half a megabyte stays in the cache


def lowpass(values: Floats, cutoff_hz: float, rate_hz: float) -> Floats:
    """Return ``values`` (n,) behind a Butterworth low-pass run forwards and backwards.

    A cut-off at or above half the rate leaves the values as they are.
    """
    if cutoff_hz >= 0.5 * rate_hz or len(values) < 2:
        return values
    sections = _design(ORDER, float(cutoff_hz), 'lowpass', float(rate_hz))
    return zero_phase(sections, values, min(_pad(sections), len(values) - 1))


def highpass(values: Floats, cutoff_hz: float, rate_hz: float) -> Floats:
    """Return ``values`` (n,) behind a Butterworth high-pass run forwards and backwards.

    Both ends are continued, mirrored in their last point, over three periods of the cut-off.
    """
    if not 0.0 < cutoff_hz < 0.5 * rate_hz or len(values) < 2:
        return np.zeros_like(values)
    sections = _design(HIGHPASS_ORDER, float(cutoff_hz), 'highpass', float(rate_hz))
    pad = min(int(3.0 * rate_hz / cutoff_hz), len(values) - 1)
    return zero_phase(sections, values, pad)


# A design takes a millisecond, as long as filtering a minute of a channel; a recording asks for few, often.
@lru_cache(maxsize=64)
def _design(order: int, cutoff_hz: float, kind: str, rate_hz: float) -> Floats:
    """Return the second-order sections of a Butterworth filter."""
    sections: Floats = signal.butter(order, cutoff_hz, kind, fs=rate_hz, output='sos')
    return sections


def zero_phase(sections: Floats, values: Floats, pad: int) -> Floats:
    """Return what ``scipy.signal.sosfiltfilt`` does, to the last bit, in a third of the memory.

    ``values`` (n,) are continued by ``pad`` samples, mirrored in their ends, and filtered piece
    by piece in place, forwards and backwards.
    """
    whole = np.empty(len(values) + 2 * pad)
    whole[pad : pad + len(values)] = values
    whole[:pad] = 2.0 * values[0] - values[pad:0:-1]
    whole[pad + len(values) :] = 2.0 * values[-1] - values[-2 : -pad - 2 : -1]
    rest = signal.sosfilt_zi(sections)
    for row in (whole, whole[::-1]):
        state = rest * row[0]
        for start in range(0, len(row), PIECE):
            piece = slice(start, start + PIECE)
            row[piece], state = signal.sosfilt(sections, row[piece], zi=state)
    return whole[pad : pad + len(values)]


def _pad(sections: Floats) -> int:
    """Return the length by which ``sosfiltfilt`` continues both ends where nobody asks."""
    n_taps = 2 * len(sections) + 1
    n_taps -= min(int((sections[:, 2] == 0).sum()), int((sections[:, 5] == 0).sum()))
    return 3 * n_taps


def inner(one: Floats, other: Floats) -> float:
    """Return the sum of products of two rows (n,).

    Not by BLAS: its threads wait busily for each other on rows as short as these.
    """
    return float(np.einsum('i,i->', one, other))


def bridge(values: Floats, valid: Mask) -> Floats:
    """Return ``values`` (n,) with straight lines where ``valid`` (n,) is false.

    Beyond the first and the last valid sample the value stays constant; without any valid
    sample the result is zero.
    """
    if valid.all():
        return values
    if not valid.any():
        return np.zeros(len(values))
    index = np.arange(len(values), dtype=np.float64)
    bridged = values.copy()
    bridged[~valid] = np.interp(index[~valid], index[valid], values[valid])
    return bridged


def centred(values: Floats) -> Floats:
    """Return ``values`` (n,) less their mean; exactly zero where they are constant."""
    if len(values) == 0:
        return values
    mean = float(values.mean())
    less = values - mean
    least = ROUNDING * abs(mean)
    # a sum of squares beyond that many times the limit's has one beyond the limit: quicker to see
    if inner(less, less) > len(less) * least**2 or np.abs(less).max() > least:
        return less
    return np.zeros(len(values))


def thinning(rate_hz: float, wanted_hz: float) -> int:
    """Return the step that thins ``rate_hz`` to at least ``wanted_hz``, 1 where it cannot."""
    return max(1, int(rate_hz / wanted_hz))


class Places(NamedTuple):
    """Fractional indices into rows of one length, with the weights of the samples about them.

    Attributes
    ----------
    first : (k,) int64
        The first of four samples.
    weights : (4, k) float64
    """

    first: NDArray[np.int64]
    weights: Floats

    def of(self, values: Floats) -> Floats:
        """Return ``values`` (n,) at the places, (k,)."""
        total = self.weights[0] * values[self.first]
        for j in (1, 2, 3):
            total += self.weights[j] * values[self.first + j]
        return np.asarray(total)


def places_at(index: Floats, n: int) -> Places:
    """Return the places at fractional ``index`` (k,) of rows of n samples, n at least four.

    By Lagrange's polynomial through four samples; its error for a sine of w radians per sample
    is at most 3/128 w**4 of the amplitude.
    """
    base = np.clip(index.astype(np.int64), 1, n - 3)
    t = index - base
    weights = (
        t * (t - 1.0) * (t - 2.0) / -6.0,
        (t + 1.0) * (t - 1.0) * (t - 2.0) / 2.0,
        (t + 1.0) * t * (t - 2.0) / -2.0,
        (t + 1.0) * t * (t - 1.0) / 6.0,
    )
    return Places(base - 1, np.stack(weights))
