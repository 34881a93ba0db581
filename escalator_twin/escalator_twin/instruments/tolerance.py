"""Draw the imperfections that the data sheet leaves an instrument in one recording."""

import numpy as np

from escalator_twin.causes.imperfections import (
    ACCELERATION,
    accelerometers,
    Clock,
    Imperfections,
    SensorErrors,
)
from escalator_twin.machine import Machine, Sensor
from escalator_twin.signals import Floats, read_only

# The recorder's latency as seen in the recordings: 4 ms and the size of a normal of 1 ms, where
# the data sheet says about 5 ms; both scale with the description's latency.
LATENCY_FLOOR, LATENCY_JITTER = 0.8, 0.2
# Strain at the edge of a link over the sum of its two rollers' normal forces, 1/N: seen in the
# recordings, exact to 0.03 microstrain; the data sheet only says that the mean of four cancels it.
BENDING_PER_N = 3.0e-9
THERMAL_SHARES = (0.5, 0.25, 0.25)  # trend, cosine, sine: together the largest drift at most


def draw_sensor(sensor: Sensor, rng: np.random.Generator) -> SensorErrors:
    """Draw one channel's errors: zero and drift per field, one gain for the whole sensor."""
    k, unit = len(sensor.fields), abs(sensor.scale)
    gain = 1.0 + rng.normal(0.0, sensor.gain_tol)
    zero = rng.uniform(-sensor.zero, sensor.zero, k)
    thermal = rng.uniform(-1.0, 1.0, (k, 3)) * THERMAL_SHARES * sensor.thermal_drift
    return SensorErrors(
        gain=read_only(np.full(k, gain)),
        zero=read_only(zero * unit),
        thermal=read_only(thermal * unit),
        noise=sensor.noise * unit,
        resolution=sensor.resolution * unit,
    )


def draw_rotation(machine: Machine, instrument: str, rng: np.random.Generator) -> Floats:
    """Draw one accelerometer's rotation vector, rad."""
    tolerance = max(
        s.rotation_tol_deg
        for s in machine.instruments.sensors
        if s.instrument == instrument and s.quantity == ACCELERATION
    )
    return read_only(np.deg2rad(rng.normal(0.0, tolerance, 3)))


def draw(machine: Machine, rng: np.random.Generator) -> Imperfections:
    """Draw the imperfections of all instruments of a machine in one recording.

    The order of the draws is that of the description; the same generator gives the same
    imperfections.

    Parameters
    ----------
    machine : Machine
        Its description gives every size.
    rng : numpy Generator
        Advanced by the draws.
    """
    instruments = machine.instruments
    clocks = {
        name: Clock(
            rng.uniform(-logger.offset_s, logger.offset_s),
            rng.uniform(-logger.drift_ppm, logger.drift_ppm),
        )
        for name, logger in instruments.loggers.items()
    }
    latency = instruments.recorder.latency_s
    return Imperfections(
        sensors={s.channel: draw_sensor(s, rng) for s in instruments.sensors},
        rotations_rad={
            name: draw_rotation(machine, name, rng) for name in accelerometers(machine)
        },
        clocks=clocks,
        latency_s=LATENCY_FLOOR * latency,
        jitter_s=LATENCY_JITTER * latency,
        bending_per_n=BENDING_PER_N,
    )
