"""A robust line through the difference of two clocks, in bins of a recorder's time."""

from typing import NamedTuple

import numpy as np

from escalator_twin.signals import Floats

# Both loggers are compared in bins: long enough for a median over tens of messages, short
# against a drift that changes; no more bins than the fit's pairs allow.
BIN_S = 0.5
MAX_BINS = 600
MIN_PER_BIN = 5
MIN_BINS = 4
RATE_POINTS = 200


class Clock(NamedTuple):
    """One logger's messages in the order of their arrival, seconds from a common origin."""

    stamp_s: Floats
    bag_s: Floats


class Line(NamedTuple):
    """Offset at the start and rate of the difference of two clocks, with standard errors."""

    offset_s: float
    offset_error_s: float
    drift: float
    drift_error: float


def bin_edges(start: float, end: float) -> Floats | None:
    """Return the edges of the bins from ``start`` to ``end``; ``None`` where it is too short."""
    width = max(BIN_S, (end - start) / MAX_BINS)
    n_bins = int((end - start) // width)
    return np.asarray(start + width * np.arange(n_bins + 1.0)) if n_bins >= MIN_BINS else None


def line_of(
    edges: Floats, moving: Floats, fixed: Floats, rate: float, first: float
) -> Line | None:
    """Fit a robust line to the difference of two clocks in bins.

    Parameters
    ----------
    edges : (n + 1,) float64
        Of the bins, in bag time, s.
    moving, fixed : (n,) float64
        As `binned` gives them; NaN where there are too few samples.
    rate : float
        What was taken out of both.
    first : float
        Where the recording starts by the fixed clock, s.
    """
    good = np.isfinite(moving) & np.isfinite(fixed)
    if good.sum() < MIN_BINS:
        return None
    time = (rate * (edges[:-1] + edges[1:]) / 2 + fixed)[good] - first
    difference = (moving - fixed)[good]
    slope = _median_slope(time, difference)
    residual = difference - slope * time
    residual -= np.median(residual)
    scale = max(1.4826 * float(np.median(np.abs(residual))), 1e-9)
    kept = np.abs(residual) < 4.0 * scale
    if kept.sum() < MIN_BINS:
        return None
    return _least_squares(time[kept], difference[kept])


def _least_squares(time: Floats, difference: Floats) -> Line:
    """Fit a line; its value is taken at time 0, the start of the recording."""
    middle = time.mean()
    spread = float(((time - middle) ** 2).sum())
    slope = float(((time - middle) * difference).sum()) / spread
    level = float(difference.mean())
    residual = difference - level - slope * (time - middle)
    variance = float((residual**2).sum()) / max(len(time) - 2, 1)
    return Line(
        level - slope * middle,
        float(np.sqrt(variance * (1.0 / len(time) + middle**2 / spread))),
        slope,
        float(np.sqrt(variance / spread)),
    )


def rate_of(clock: Clock) -> float:
    """Return how fast a logger's stamps run by bag time: 1, but in a replay at another rate."""
    chosen = np.linspace(0, len(clock.bag_s) - 1, RATE_POINTS).astype(int)
    return _median_slope(clock.bag_s[chosen], clock.stamp_s[chosen])


def _median_slope(x: Floats, y: Floats) -> float:
    """Return the median of the slopes of all pairs of points (Theil 1950, Sen 1968)."""
    i, j = np.triu_indices(len(x), 1)
    run = x[j] - x[i]
    return float(np.median((y[j] - y[i])[run != 0.0] / run[run != 0.0]))


def binned(clock: Clock, edges: Floats, quantile: float, rate: float) -> Floats:
    """Return a quantile of stamps less ``rate`` times bag time, by bins of bag time.

    NaN where a bin has too few.
    """
    result = np.full(len(edges) - 1, np.nan)
    where = np.digitize(clock.bag_s, edges) - 1
    inside = (where >= 0) & (where < len(result))
    order = np.argsort(where[inside], kind='stable')
    values_in_order = (clock.stamp_s - rate * clock.bag_s)[inside][order]
    bounds = np.searchsorted(where[inside][order], np.arange(len(result) + 1))
    for k in range(len(result)):
        values = values_in_order[bounds[k] : bounds[k + 1]]
        if len(values) >= MIN_PER_BIN:
            result[k] = np.quantile(values, quantile)
    return result
