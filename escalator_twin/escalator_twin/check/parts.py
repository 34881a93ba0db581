"""The parts of a channel, with their noise and by how little they change."""

from typing import NamedTuple

import numpy as np

from escalator_twin.machine import Sensor
from escalator_twin.signals import Finding, Floats, Signal

FINEST = 0.01  # of a signal's changes: noise without a resolution changes by a sixtieth of itself
MIN_CHANGES = 100  # that say so: fewer may be outliers of a dead channel


class Part(NamedTuple):
    """One field of a sensor, in the field's own unit scaled to the channel's."""

    values: Floats
    noise: float
    resolution: float


def parts_of(signal: Signal, sensor: Sensor) -> list[Part]:
    """Return a channel's fields with their noise in the channel's unit.

    Where the description gives no noise, that of the signal's second differences is taken; where the signal
    is coarser than described, its own resolution.
    """
    parts = []
    for k in range(signal.parts.shape[1]):
        values = np.ascontiguousarray(signal.parts[:, k])
        noise = sensor.noise * abs(sensor.scale)
        resolution = max(sensor.resolution * abs(sensor.scale), own_resolution(values))
        parts.append(Part(values, noise or own_noise(values), resolution))
    return parts


def own_resolution(values: Floats) -> float:
    """Return by how little a signal ever changes: its resolution, where that is coarse beside its noise."""
    changes = np.abs(np.diff(values))
    changes = changes[changes > 0.0]
    return float(np.quantile(changes, FINEST)) if len(changes) >= MIN_CHANGES else 0.0


def is_coarse(part: Part) -> bool:
    """Tell whether a signal's noise does not move it from one step of its resolution to the next.

    How long it stands on one says how slow it is there, and nothing of whether it lives.
    """
    return part.resolution > part.noise * float(np.sqrt(2.0 * np.pi))


def own_noise(values: Floats) -> float:
    """Return the noise of a signal by its second differences, robust against what happens."""
    if len(values) < 5:
        return 0.0
    # white noise of sigma has second differences of sqrt(6) sigma
    second = np.diff(values, 2)
    return float(1.4826 * np.median(np.abs(second)) / np.sqrt(6.0))


def in_field(value: float, sensor: Sensor) -> float:
    """Return a channel's value, or amplitude, in its field's own unit."""
    return value / abs(sensor.scale)


def finding_of(
    kind: str, signal: Signal, time_s: Floats, begin: int, end: int, text: str
) -> Finding:
    """Return what was found in a channel from one sample to another."""
    return Finding(kind, signal.channel, float(time_s[begin]), float(time_s[end]), text)
