"""The delay that is left between two signals."""

import numpy as np
from scipy import signal

from escalator_twin.metrics.filters import inner, Mask, thinning
from escalator_twin.signals import Floats

MAX_LAG_S = 2.0  # the margin at each end of a recording
LAG_RATE_HZ = 40.0  # twenty samples per period of the 2 Hz low-pass
# a nearer peak is preferred where its misfit is at most so much larger than the best one's
SAME_PEAK = 1.5
SAME_LOSS = 1e-6


def remaining_lag(
    measured: Floats, simulated: Floats, rate_hz: float, kept: slice, valid: Mask | None = None
) -> float | None:
    """Return by how much the measured signal is later, s.

    It is the shift, within 2 s, at which Pearson's correlation of the measured samples kept
    and the shifted simulation is largest; each shift has its own means and deviations, so
    that a slow signal in a short window gives no bias. A parabola through the three
    highest values gives the part below a sample. Of peaks that fit alike, as those of a
    periodic signal, the nearest to zero is taken.

    Parameters
    ----------
    measured, simulated : (n,) float64
        Low-passed signals of the whole recording; what lies beyond ``kept`` is used for
        shifting.
    rate_hz : float
        Rate of both, Hz.
    kept : slice
        Samples of the measured signal that count.
    valid : (n,) bool, optional
        Samples of the measured signal that are real.

    Returns
    -------
    float or None
        ``None`` for a constant signal, or where no peak lies within the reach.
    """
    step = thinning(rate_hz, LAG_RATE_HZ)
    room = min(kept.start, len(measured) - kept.stop, int(MAX_LAG_S * rate_hz))
    reach = room // step
    if kept.stop - kept.start < 2 * step or reach < 2:
        return None
    m = measured[kept][::step]
    shifted = simulated[kept.start - reach * step : kept.stop + reach * step][::step]
    shifted = shifted[: len(m) + 2 * reach]
    weight = np.ones(len(m)) if valid is None else valid[kept][::step].astype(np.float64)
    curve = _moving_correlation(m, shifted, weight)
    peak = None if curve is None else _peak(curve, reach)
    # index 0 is the simulation's earliest piece: the measured signal latest
    return None if peak is None else float((reach - peak) * step / rate_hz)


def _moving_correlation(m: Floats, shifted: Floats, weight: Floats) -> Floats | None:
    """Return the weighted correlation of ``m`` (n,) with each window of ``shifted`` (n + k - 1,).

    ``None`` where either is constant.
    """
    total = weight.sum()
    if total < 2.0:
        return None
    m = weight * (m - inner(weight, m) / total)
    s = shifted - shifted.mean()
    power = inner(m, m)
    if not power > 0.0:
        return None
    cross = signal.correlate(s, m, mode='valid', method='fft')
    if weight.all():
        sums, squares = _moving_sum(s, len(m)), _moving_sum(s * s, len(m))
    else:
        sums = signal.correlate(s, weight, mode='valid', method='fft')
        squares = signal.correlate(s * s, weight, mode='valid', method='fft')
    spread = squares - sums**2 / total
    if not spread.min() > 1e-12 * squares.max():
        return None
    return cross / np.sqrt(power * spread)


def _moving_sum(values: Floats, n: int) -> Floats:
    """Return the sums of all ``n`` neighbours."""
    sums = np.concatenate(([0.0], np.cumsum(values)))
    return sums[n:] - sums[:-n]


def _peak(curve: Floats, centre: int) -> float | None:
    """Return the fractional index of the peak of ``curve`` that counts."""
    middle = curve[1:-1]
    peaks = 1 + np.flatnonzero((middle >= curve[:-2]) & (middle >= curve[2:]))
    if len(peaks) == 0:
        return None
    loss = 1.0 - curve[peaks]
    if 1.0 - max(curve[0], curve[-1]) < loss.min() - SAME_LOSS:
        return None
    alike = peaks[loss <= SAME_PEAK * loss.min() + SAME_LOSS]
    best = int(alike[np.argmin(np.abs(alike - centre))])
    before, here, after = curve[best - 1], curve[best], curve[best + 1]
    bend = before - 2.0 * here + after
    return float(best) if bend >= 0.0 else float(best + 0.5 * (before - after) / bend)
