"""Creep of gauges that shows without a model: one loop against the next, link against link."""

from collections.abc import Container

import numpy as np

from escalator_twin.machine import Machine, Sensor
from escalator_twin.signals import Finding, Floats, Recording, Signal

QUANTITY = 'link_force'
GRID_HZ = 10.0  # means over a tenth of a second
# A link's creep counts beyond this many times the thermal drift that its gauges may have: 5e-6
# strain of the prototype's, twice and a half its 2e-6, half of the creep that matters.
THERMAL = 2.5
# The shortest overlap of one loop with the next, in loops, that a mean is taken over.
MIN_OVERLAP = 0.2
# How far a loop's duration may be off what the set speed says.
SPEED_SHARE = 0.12


def drifts(recording: Recording, machine: Machine, faulty: Container[str] = ()) -> list[Finding]:
    """Find links that creep away from the others between two passages of the same places.

    A loop's duration is where a link's force repeats best; the median difference of the two
    passages, over the time between them, is the creep's rate.

    Parameters
    ----------
    recording : Recording
        Its experiment tells about how long a loop takes.
    machine : Machine
        Describes the links' gauges.
    faulty : container of str
        Channels with another fault: these are left out.
    """
    sensors = [
        s
        for s in machine.instruments.sensors
        if s.quantity == QUANTITY
        and s.thermal_drift
        and s.channel in recording.signals
        and s.channel not in faulty
    ]
    if len(sensors) < 3 or recording.experiment is None:
        return []  # nothing to stand out from, or no idea of a loop's duration
    length = machine.chain.n_links * machine.chain.pitch_m
    expected = length / recording.experiment.set_speed_m_s
    creep = {}
    for sensor in sensors:
        value = _creep(recording.signals[sensor.channel], expected)
        if value is None:
            return []
        creep[sensor.channel] = value / abs(sensor.scale)
    return _standing_out(sensors, creep, recording)


def _standing_out(
    sensors: list[Sensor], creep: dict[str, float], recording: Recording
) -> list[Finding]:
    findings = []
    for sensor in sensors:
        others = [value for name, value in creep.items() if name != sensor.channel]
        excess = creep[sensor.channel] - float(np.median(others))
        if abs(excess) > THERMAL * sensor.thermal_drift:
            stamps = recording.signals[sensor.channel].stamp_ns
            text = (
                f'creeps by {excess:+.2g} (mean of the fields) over the recording '
                f'against the other links'
            )
            end_s = float(stamps[-1] - stamps[0]) / 1e9
            findings.append(Finding('gauge_drift', sensor.channel, 0.0, end_s, text))
    return findings


def _creep(signal: Signal, expected_s: float) -> float | None:
    """Return how much a signal changes over the recording, place by place; ``None``: unknown."""
    time = (signal.stamp_ns - signal.stamp_ns[0]) / 1e9
    if float(time[-1]) * GRID_HZ > len(time):
        return None  # mostly gaps
    edges = np.arange(0.0, float(time[-1]), 1.0 / GRID_HZ)
    if len(edges) < (1.0 + MIN_OVERLAP) * expected_s * GRID_HZ:
        return None
    total = np.concatenate([[0.0], np.cumsum(signal.values)])
    bounds = np.searchsorted(time, edges)
    count = np.diff(bounds)
    if (count == 0).any():
        return None  # a gap: no passage to compare
    values = np.diff(total[bounds]) / count
    lag = _loop_lag(values, expected_s)
    if lag is None:
        return None
    difference = values[lag:] - values[:-lag]
    return float(np.median(difference)) * len(values) / lag


def _loop_lag(values: Floats, expected_s: float) -> int | None:
    """Return the number of samples after which a signal repeats best."""
    low, high = (
        int(expected_s * GRID_HZ * share) for share in (1.0 - SPEED_SHARE, 1.0 + SPEED_SHARE)
    )
    high = min(high, int(len(values) / (1.0 + MIN_OVERLAP)))
    lags = range(low, high + 1)
    if len(lags) < 3:
        return None
    misfit = [float(np.std(values[lag:] - values[:-lag])) for lag in lags]
    return lags[int(np.argmin(misfit))]
