"""Follow travel by a signal that repeats once per loop of the chain."""

import numpy as np
from scipy import signal

from escalator_twin.metrics.filters import bridge, highpass, lowpass, Mask
from escalator_twin.signals import Floats
from escalator_twin.sync.course import Basis, Course, huber_weight, LEAST_OBSERVED, robust_scale

BAND = (0.5, 4.5)  # cycles per pitch: slower drifts with the sensor, faster is chatter
WINDOW_CYCLES = 6.0  # of the signal that is looked for one loop later; a quarter to the next
SAMPLES = 12.0  # per cycle of the band's upper end
REACH_CYCLES = 0.4  # about the common lag: a wander's worth
LEAST_R = 0.6  # correlation below which a stretch was not found again
ROUNDS = 5


def follow_loops(
    time_s: Floats,
    columns: Floats,
    valid: Mask,
    n_cycles: float,
    wander: float,
    around: tuple[float, float],
) -> Course | None:
    """Return the course of the cycles from stretches that come again one loop later.

    A stretch around t that is found again at t + T says that ``n_cycles`` passed in T. The
    spline through all of these is that of `follow_phase`, with a mean that they fix.

    Parameters
    ----------
    time_s : (n,) float64
        Increasing from 0, s.
    columns : (n, k) float64
        Signals.
    valid : (n, k) bool
        Samples to trust.
    n_cycles : float
        Pitches of a loop.
    wander : float
        Relative wander of the frequency.
    around : tuple of float
        Frequency of the pitch, Hz, and the relative error that it may have.

    Returns
    -------
    Course or None
        ``None`` where too little comes again.
    """
    base_hz, reach = around
    span = float(time_s[-1])
    rate = min((len(time_s) - 1) / span, SAMPLES * BAND[1] * base_hz)
    rows = _even(time_s, columns, valid, base_hz, rate)
    half = round(0.5 * WINDOW_CYCLES / base_hz * rate)
    lag = _common_lag(rows, n_cycles / base_hz * rate, reach, 2 * half)
    if lag is None:
        return None
    centres, lags = _lags(rows, lag, half, round(REACH_CYCLES / base_hz * rate))
    if len(centres) < LEAST_OBSERVED:
        return None
    first, later = centres / rate, np.minimum((centres + lags) / rate, span)
    basis = Basis.over(span, base_hz * wander)
    design = basis.at(later) - basis.at(first)
    observed = n_cycles - base_hz * (later - first)
    variance = np.ones(len(centres))
    for _ in range(ROUNDS):
        smooth = basis.smooth(design, observed, variance)
        off = observed - design @ smooth.cycles
        variance = 1.0 / huber_weight(off, robust_scale(off, smooth.n_free))
    return basis.course(base_hz, smooth, off / np.sqrt(variance))


def _even(time: Floats, columns: Floats, valid: Mask, base_hz: float, rate: float) -> Floats:
    """Return the signals (k, m) on an even grid, in the band, each of deviation one."""
    grid = np.arange(0.0, time[-1], 1.0 / rate)
    own = (len(time) - 1) / time[-1]
    rows = []
    for column, real in zip(columns.T, valid.T, strict=True):
        whole = bridge(column, real)
        smooth = lowpass(whole - whole.mean(), BAND[1] * base_hz, own)
        even = highpass(np.interp(grid, time, smooth), BAND[0] * base_hz, rate)
        rows.append(even / max(float(even.std()), 1e-300))
    return np.array(rows)


def _common_lag(rows: Floats, guess: float, reach: float, least: int) -> float | None:
    """Return the lag, samples, at which the signals as a whole come again."""
    n = rows.shape[1]
    lags = np.arange(round(guess * (1.0 - reach)), round(guess * (1.0 + reach)) + 1)
    lags = lags[(lags > 0) & (n - lags >= least)]
    if len(lags) < 3:
        return None
    curve = np.array([_alike(rows[:, : n - lag], rows[:, lag:]) for lag in lags])
    return float(lags[int(np.argmax(curve))]) if curve.max() >= LEAST_R else None


def _alike(first: Floats, second: Floats) -> float:
    """Return the correlation of two sets of rows (k, m) without means."""
    power = float(np.sum(first**2) * np.sum(second**2))
    return float(np.sum(first * second)) / np.sqrt(power) if power > 0.0 else 0.0


def _lags(rows: Floats, lag: float, half: int, reach: int) -> tuple[Floats, Floats]:
    """Return the middles of stretches and after how many samples each comes again."""
    n = rows.shape[1]
    found = []
    common = round(lag)
    last = n - common - reach - half
    for centre in range(half, last, max(half // 2, 1)):
        piece = rows[:, centre - half : centre + half]
        start = centre - half + common - reach
        later = rows[:, start : start + 2 * half + 2 * reach]
        cross = sum(signal.correlate(b, a, 'valid') for a, b in zip(piece, later, strict=True))
        power = sum(np.convolve(b**2, np.ones(2 * half), 'valid') for b in later)
        curve = cross / np.sqrt(np.maximum(power * np.sum(piece**2), 1e-300))
        best = int(np.argmax(curve))
        if curve[best] < LEAST_R or not 0 < best < len(curve) - 1:
            continue
        before, here, after = curve[best - 1 : best + 2]
        part = 0.5 * (before - after) / (before - 2.0 * here + after)
        found.append((float(centre), common - reach + best + float(part)))
    table = np.array(found).reshape(-1, 2)
    return table[:, 0], table[:, 1]
