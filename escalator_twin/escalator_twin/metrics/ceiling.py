"""The noise ceiling: how well the measurement agrees with itself, one loop later."""

import numpy as np

from escalator_twin.metrics.agreement import correlation
from escalator_twin.metrics.bands import Bands
from escalator_twin.signals import Floats

LEAST_SHARE = 0.25  # of a loop that must have been passed twice


def ceiling_share(bands: Bands) -> float | None:
    """Return the share of a loop that was passed twice; ``None`` below a quarter."""
    share = bands.track.passed_twice
    return share if share >= LEAST_SHARE else None


def ceiling_r_time(bands: Bands) -> float | None:
    """Return the correlation, below 2 Hz, of two passages of the same loop positions.

    All places 2 s inside the ends that are passed again one loop later count, each with its
    next passage, resampled by travel. Both passages carry noise: a perfect simulation
    reaches about the square root of it. ``None`` where less than a quarter of a loop was
    passed twice.
    """
    return _self_correlation(bands, bands.low.measured[:: bands.track.step])


def ripple_ceiling(bands: Bands) -> float | None:
    """Return the same as `ceiling_r_time` for the ripple."""
    return _self_correlation(bands, bands.ripple.measured)


def trend_ceiling(bands: Bands) -> float | None:
    """Return the same as `ceiling_r_time` for the trend."""
    return _self_correlation(bands, bands.trend.measured)


def _self_correlation(bands: Bands, thin: Floats) -> float | None:
    """Correlate ``thin``, on the grid thinned by the track's step, with itself a loop later."""
    if ceiling_share(bands) is None:
        return None
    first, second = bands.track.passages
    valid = bands.valid[:: bands.track.step]
    real = valid[first] & valid[np.rint(second).astype(np.int64)]
    again = interpolate(thin, second)
    if real.all():
        return correlation(thin[first], again)
    return correlation(thin[first][real], again[real])


def interpolate(values: Floats, index: Floats) -> Floats:
    """Return ``values`` (n,) at fractional ``index`` (k,), by a cubic through four samples.

    Lagrange's polynomial; its error for a sine of w radians per sample is at most
    3/128 w**4 of the amplitude.
    """
    n = len(values)
    if n < 4:
        return np.interp(index, np.arange(n), values)
    base = np.clip(index.astype(np.int64), 1, n - 3)
    t = index - base
    return (
        values[base - 1] * (t * (t - 1.0) * (t - 2.0) / -6.0)
        + values[base] * ((t + 1.0) * (t - 1.0) * (t - 2.0) / 2.0)
        + values[base + 1] * ((t + 1.0) * t * (t - 2.0) / -2.0)
        + values[base + 2] * ((t + 1.0) * t * (t - 1.0) / 6.0)
    )
