"""A trace of the twin as a recording: with ideal instruments, or with real ones."""

import numpy as np

from escalator_twin.causes import alter_imperfections, alter_recording
from escalator_twin.causes.imperfections import Imperfections, perfect
from escalator_twin.errors import RecordingError
from escalator_twin.instruments.sampling import (
    bending,
    read_out,
    rotated,
    tick,
    Ticks,
    values_at,
)
from escalator_twin.instruments.tolerance import draw
from escalator_twin.machine import Deviation, Machine, Sensor
from escalator_twin.physics.rollout import Trace
from escalator_twin.signals import Experiment, Floats, make_signal, Recording, Signal

START_NS = 1_800_000_000_000_000_000  # ns, an arbitrary date that all recordings share


def recorded_sensors(machine: Machine) -> tuple[Sensor, ...]:
    """Return the sensors whose columns a trace needs for a recording with all its parts."""
    return machine.instruments.sensors + machine.instruments.simulated_only


def ideal(
    trace: Trace,
    machine: Machine,
    experiment: Experiment | None = None,
    start_ns: int = START_NS,
) -> Recording:
    """Return a trace as ideal instruments record it: exact values, one clock, no latency.

    The machine's deviations of the measurement are applied.

    Parameters
    ----------
    trace : Trace
        Its columns are those of ``machine.instruments.sensors``, with or without
        ``simulated_only`` behind them.
    machine : Machine
        Description of the instruments and deviations.
    experiment : Experiment, optional
        Kept in the recording.
    start_ns : int
        Stamp of the first sample, ns.
    """
    rng = np.random.default_rng(0)
    return _recorded(trace, machine, perfect(machine), (experiment, start_ns), (), rng)


def record(
    trace: Trace,
    machine: Machine,
    experiment: Experiment | None = None,
    seed: int = 0,
    deviations: tuple[Deviation, ...] = (),
    start_ns: int = START_NS,
) -> Recording:
    """Return a trace as real instruments record it, their imperfections drawn from a seed.

    Parameters
    ----------
    trace : Trace
        As for `ideal`; with the columns of ``simulated_only`` the gauges show bending too. A
        trace of several times the loggers' rates is interpolated with less error.
    machine : Machine
        Description of the instruments and deviations.
    experiment : Experiment, optional
        Kept in the recording.
    seed : int
        The same seed gives the same recording.
    deviations : tuple of Deviation
        Causes of the measurement beside those of the machine's description.
    start_ns : int
        The recorder's clock at the trace's start, ns.
    """
    rng = np.random.default_rng(seed)
    imperfections = draw(machine, rng)
    return _recorded(trace, machine, imperfections, (experiment, start_ns), deviations, rng)


def _recorded(
    trace: Trace,
    machine: Machine,
    imperfections: Imperfections,
    header: tuple[Experiment | None, int],
    deviations: tuple[Deviation, ...],
    rng: np.random.Generator,
) -> Recording:
    """Apply the deviations of the measurement and read every sensor out."""
    experiment, start_ns = header
    deviations = (*machine.deviations, *deviations)
    imperfections = alter_imperfections(imperfections, machine, deviations)
    sensors = _sensors_of(trace, machine)
    columns = {s.channel: trace.columns[:, i] for i, s in enumerate(sensors)}
    duration_s = float(trace.time_s[-1]) if len(trace.time_s) else 0.0
    ticks: dict[tuple[str, float], Ticks] = {}
    signals = {}
    for sensor in sensors:
        key = (sensor.logger, sensor.rate_hz)
        if key not in ticks:
            ticks[key] = tick(
                sensor.rate_hz, sensor.logger, duration_s, imperfections, start_ns, rng
            )
        true = _true_parts(trace, machine, sensor, columns, imperfections, ticks[key])
        signals[sensor.channel] = _signal(sensor, true, duration_s, imperfections, ticks[key], rng)
    recording = Recording('', signals, experiment)
    return alter_recording(recording, machine, deviations, rng)


def _sensors_of(trace: Trace, machine: Machine) -> tuple[Sensor, ...]:
    """Return the sensors that a trace's columns belong to.

    Raises
    ------
    RecordingError
        Where there are more or fewer columns than the machine describes.
    """
    n, everything = trace.columns.shape[1], recorded_sensors(machine)
    if n not in (len(machine.instruments.sensors), len(everything)):
        raise RecordingError(
            f'trace: expected {len(machine.instruments.sensors)} columns (sensors) or '
            f'{len(everything)} (with simulated_only), found {n}'
        )
    return everything[:n]


def _true_parts(
    trace: Trace,
    machine: Machine,
    sensor: Sensor,
    columns: dict[str, Floats],
    imperfections: Imperfections,
    ticks: Ticks,
) -> Floats:
    """Return what a sensor's fields are exposed to at its ticks, (n, k)."""
    column = columns[sensor.channel]
    rotation = imperfections.rotations_rad.get(sensor.instrument)
    if rotation is not None and rotation.any() and 'axis' in sensor.at:
        column = rotated(machine, sensor, columns, rotation)
    k = len(sensor.fields)
    parts = np.repeat(values_at(trace, column, ticks.true_s)[:, None], k, axis=1)
    bent = bending(machine, sensor, columns, imperfections.bending_per_n)
    if bent is None:
        return parts
    return np.asarray(
        parts + np.stack([values_at(trace, bent[:, i], ticks.true_s) for i in range(k)], axis=1)
    )


def _signal(
    sensor: Sensor,
    true_parts: Floats,
    duration_s: float,
    imperfections: Imperfections,
    ticks: Ticks,
    rng: np.random.Generator,
) -> Signal:
    """Return one channel; a sensor that no instrument has is exact."""
    errors = imperfections.sensors.get(sensor.channel)
    parts = true_parts
    if errors is not None:
        parts = read_out(true_parts, ticks.true_s, duration_s, errors, rng)
    return make_signal(sensor.channel, sensor.unit, ticks.stamp_ns, ticks.bag_ns, parts)
