"""One channel's scores as the JSON of `compare` holds them."""

from escalator_twin.metrics.bands import split_bands
from escalator_twin.metrics.filters import Mask
from escalator_twin.metrics.registry import CONTRACT, Score, score
from escalator_twin.metrics.track import Track
from escalator_twin.signals import Floats


def score_channel(
    measured: Floats,
    simulated: Floats,
    track: Track,
    valid: Mask | None = None,
    names: tuple[str, ...] = CONTRACT,
) -> dict[str, Score]:
    """Return the metrics of one channel, ready for JSON: ``None`` where one is undefined.

    Parameters
    ----------
    measured, simulated : (n,) float64
        The channel on the track's grid, aligned by travel, its own unit. Accelerations come
        behind `remove_sensor_pose`.
    track : Track
        Where each sample was taken; one object for all channels of a recording, which it
        spares the common work.
    valid : (n,) bool, optional
        False for samples that do not count.
    names : tuple of str
        Which of `METRICS`; those of the contract where nobody asks.
    """
    return score(split_bands(measured, simulated, track, valid), names)
