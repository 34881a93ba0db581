"""The noise ceiling: how well the measurement agrees with itself, one loop later."""

from escalator_twin.metrics.bands import Bands

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
    return None if ceiling_share(bands) is None else bands.low_twice.products.correlation


def ripple_ceiling(bands: Bands) -> float | None:
    """Return the same as `ceiling_r_time` for the ripple."""
    return None if ceiling_share(bands) is None else bands.ripple_twice.products.correlation


def trend_ceiling(bands: Bands) -> float | None:
    """Return the same as `ceiling_r_time` for the trend."""
    return None if ceiling_share(bands) is None else bands.trend_twice.products.correlation
