"""What loggers and recorder make of a trace, given their imperfections."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

from escalator_twin.causes.imperfections import (
    ACCELERATION,
    creep_shape,
    Imperfections,
    SensorErrors,
)
from escalator_twin.causes.places import AXES, LINK_FORCE
from escalator_twin.machine import Machine, Sensor
from escalator_twin.physics.rollout import Trace
from escalator_twin.signals import Floats, Nanoseconds

NS = 1_000_000_000
ON_GRID = 1e-6  # of a sample's interval: closer to the trace's own samples is on them


@dataclass(frozen=True)
class Ticks:
    """When one logger samples.

    Attributes
    ----------
    true_s : (n,) float64
        Time since the trace's start on the recorder's clock, s.
    stamp_ns : (n,) int64
        The logger's own clock.
    bag_ns : (n,) int64
        The recorder's clock as the message arrives.
    """

    true_s: Floats
    stamp_ns: Nanoseconds
    bag_ns: Nanoseconds


def tick(
    rate_hz: float,
    logger: str,
    duration_s: float,
    imperfections: Imperfections,
    start_ns: int,
    rng: np.random.Generator,
) -> Ticks:
    """Return the ticks of a logger within a trace; stamps are even on its own clock."""
    clock = imperfections.clocks.get(logger)
    offset_s, rate = (clock.offset_s, 1.0 + clock.drift_ppm * 1e-6) if clock else (0.0, 1.0)
    n = int(np.floor(duration_s * rate * rate_hz + ON_GRID)) + 1
    own_s = np.arange(n) / rate_hz
    true_s = own_s / rate
    late_s = imperfections.latency_s + np.abs(rng.normal(0.0, imperfections.jitter_s, n))
    stamp_ns = start_ns + round(offset_s * NS) + np.round(own_s * NS).astype(np.int64)
    bag_ns = start_ns + np.round((true_s + late_s) * NS).astype(np.int64)
    return Ticks(true_s, stamp_ns, np.maximum.accumulate(bag_ns))


def values_at(trace: Trace, column: Floats, time_s: Floats) -> Floats:
    """Return a column of a trace at given times: its own samples, or a cubic spline."""
    if len(trace.time_s) < 2:
        return np.full(len(time_s), column[0])
    place = time_s / (trace.time_s[1] - trace.time_s[0])
    nearest = np.round(place).astype(np.int64)
    if np.abs(place - nearest).max() < ON_GRID and nearest.max() < len(column):
        return column[nearest]
    return np.asarray(CubicSpline(trace.time_s, column)(time_s))


def rotated(
    machine: Machine, sensor: Sensor, columns: dict[str, Floats], rotation_rad: Floats
) -> Floats:
    """Return what one axis of a turned accelerometer sees: its row of R^T f.

    ``columns`` maps channels to their true values; an axis that is not there counts as 0.
    """
    triad = {
        str(s.at.get('axis')): columns[s.channel]
        for s in machine.instruments.sensors
        if s.instrument == sensor.instrument
        and s.quantity == ACCELERATION
        and s.at.get('step') == sensor.at.get('step')
        and s.channel in columns
    }
    turn = Rotation.from_rotvec(np.array(rotation_rad)).as_matrix()  # scipy wants it writable
    row = turn[:, AXES.index(str(sensor.at['axis']))]
    seen = sum(share * triad[axis] for share, axis in zip(row, AXES, strict=True) if axis in triad)
    return np.asarray(seen, dtype=np.float64)


def bending(
    machine: Machine, sensor: Sensor, columns: dict[str, Floats], per_n: float
) -> Floats | None:
    """Return the bending part of a link's gauges, (n, k) in N; ``None`` where it is not known.

    ``per_n`` is the strain per newton of normal force. It needs the normal forces of the link's
    two rollers among the trace's columns.
    """
    if sensor.quantity != LINK_FORCE or not sensor.bending or per_n == 0.0:
        return None
    link, side = sensor.at.get('link'), sensor.at.get('side')
    axles = (link, (int(str(link)) + 1) % machine.chain.n_links)
    normal = [
        columns[s.channel]
        for s in machine.instruments.simulated_only
        if s.quantity == 'roller_normal_force'
        and s.at.get('side') == side
        and s.at.get('axle') in axles
        and s.channel in columns
    ]
    if len(normal) != len(axles):
        return None
    size = per_n * abs(sensor.scale) * (normal[0] + normal[1])
    return np.asarray(size[:, None] * np.array(sensor.bending))


def read_out(
    true_parts: Floats,
    true_s: Floats,
    duration_s: float,
    errors: SensorErrors,
    rng: np.random.Generator,
) -> Floats:
    """Return what a sensor's fields read: gain, zero, drifts, tones, noise, resolution.

    Parameters
    ----------
    true_parts : (n, k) float64
        What the fields are exposed to.
    true_s : (n,) float64
        Time since the recording's start, s.
    duration_s : float
        Of the recording.
    errors : SensorErrors
        Of this sensor.
    rng : numpy Generator
        For the noise.
    """
    part = true_s / duration_s if duration_s > 0.0 else np.zeros(len(true_s))
    parts = true_parts * errors.gain + errors.zero
    if errors.thermal.any():
        angle = 2.0 * np.pi * part
        course = np.stack([2.0 * part - 1.0, np.cos(angle), np.sin(angle)], axis=1)
        parts = parts + course @ errors.thermal.T
    for creep in errors.creep:
        parts = parts + creep.size * creep_shape(part, creep.curvature)[:, None]
    for tone in errors.tones:
        angle = 2.0 * np.pi * tone.frequency_hz * true_s + tone.phase_rad
        parts = parts + tone.amplitude * np.sin(angle)[:, None]
    if errors.noise > 0.0:
        parts = parts + rng.normal(0.0, errors.noise, parts.shape)
    if errors.resolution > 0.0:
        parts = np.round(parts / errors.resolution) * errors.resolution
    return np.asarray(parts)
