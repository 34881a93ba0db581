"""What an instrument does to a true signal, as numbers; all neutral in an ideal one."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from escalator_twin.errors import MachineError
from escalator_twin.machine import Machine, Sensor
from escalator_twin.signals import Floats, read_only

ACCELERATION = 'step_acceleration'


class Creep(NamedTuple):
    """A drift from 0 to ``size`` (channel's unit) over the recording; see `creep_shape`."""

    size: float
    curvature: float


class Tone(NamedTuple):
    """A sine: amplitude in the channel's unit, frequency in Hz, phase in rad at the start."""

    amplitude: float
    frequency_hz: float
    phase_rad: float


class Clock(NamedTuple):
    """A logger's clock against the recorder's: at the start, and its rate."""

    offset_s: float = 0.0
    drift_ppm: float = 0.0


@dataclass(frozen=True)
class SensorErrors:
    """One channel's imperfections, in its own unit; k message fields.

    Attributes
    ----------
    gain : (k,) float64
        Reading over truth.
    zero : (k,) float64
    thermal : (k, 3) float64
        Trend, cosine and sine over the recording's length.
    creep : tuple of Creep
    tones : tuple of Tone
    noise, resolution : float
        Standard deviation and step of one field.
    """

    gain: Floats
    zero: Floats
    thermal: Floats
    creep: tuple[Creep, ...] = ()
    tones: tuple[Tone, ...] = ()
    noise: float = 0.0
    resolution: float = 0.0


@dataclass(frozen=True)
class Imperfections:
    """All instruments of a machine in one recording.

    Attributes
    ----------
    sensors : mapping of channel to SensorErrors
    rotations_rad : mapping of instrument to (3,) float64
        Rotation vector of an accelerometer in the step frame, right-hand.
    clocks : mapping of logger to Clock
    latency_s, jitter_s : float
        The recorder's: latency + abs(normal of this standard deviation).
    bending_per_n : float
        Strain at a link's edge over the sum of its two rollers' normal forces, 1/N.
    """

    sensors: Mapping[str, SensorErrors]
    rotations_rad: Mapping[str, Floats] = field(default_factory=dict)
    clocks: Mapping[str, Clock] = field(default_factory=dict)
    latency_s: float = 0.0
    jitter_s: float = 0.0
    bending_per_n: float = 0.0

    def with_sensor(self, channel: str, errors: SensorErrors) -> 'Imperfections':
        """Return these with one channel's errors replaced."""
        return replace(self, sensors={**self.sensors, channel: errors})


def creep_shape(part: Floats, curvature: float) -> Floats:
    r"""Return a creep's course from 0 to 1 over the parts, 0 to 1, of a recording.

    .. math:: g(x) = (1 - e^{-c x}) / (1 - e^{-c}),  \quad g(x) = x \text{ where } c = 0
    """
    if curvature == 0.0:
        return part
    return np.asarray(np.expm1(-curvature * part) / np.expm1(-curvature))


def perfect_sensor(sensor: Sensor) -> SensorErrors:
    """Return the errors of a sensor that has none."""
    k = len(sensor.fields)
    return SensorErrors(read_only(np.ones(k)), read_only(np.zeros(k)), read_only(np.zeros((k, 3))))


def perfect(machine: Machine) -> Imperfections:
    """Return ideal instruments: exact values, one clock, no latency."""
    instruments = machine.instruments
    return Imperfections(
        sensors={s.channel: perfect_sensor(s) for s in instruments.sensors},
        rotations_rad={name: read_only(np.zeros(3)) for name in accelerometers(machine)},
        clocks={name: Clock() for name in instruments.loggers},
    )


def accelerometers(machine: Machine) -> tuple[str, ...]:
    """Return the instruments that measure a step's acceleration, in the order of the file."""
    names = [s.instrument for s in machine.instruments.sensors if s.quantity == ACCELERATION]
    if not names:
        return ()
    return tuple(dict.fromkeys(names))


def needed(names: tuple[str, ...], what: str) -> tuple[str, ...]:
    """Return ``names``; a MachineError says that the machine has no ``what``."""
    if not names:
        raise MachineError(f'instruments.sensors: expected {what}, found none')
    return names
