"""An experiment on the simulated machine: what is asked for, how far it is, what it gives."""

from dataclasses import dataclass, field
import time

import numpy as np

from escalator_twin.comparison.locate import RATE_HZ
from escalator_twin.errors import ExperimentError
from escalator_twin.machine import Machine, Sensor
from escalator_twin.ros.outputs import NS, sensors_of
from escalator_twin.signals import Experiment, Floats, Nanoseconds
from escalator_twin.twin import AnySimulation

ACHIEVED_S = 2.0  # over which the achieved real-time factor is measured


@dataclass(frozen=True)
class Order:
    """What a run is asked to be.

    Attributes
    ----------
    experiment : Experiment
        ``set_speed_m_s`` is the real speed.
    start_s_m : float
        Path coordinate of axle 0 at the first sample.
    duration_s : float
        0: no end.
    epoch_ns : int
        Simulated time of the first sample.
    sample_rate_hz : float
        Of every sensor; 0: each at its instrument's own.
    real_time_factor : float
        0: as the simulator's parameter says; below 0: as fast as possible.
    listener : str
        Whom the run waits for; empty: nobody.
    ahead_s : float
        How far it may run ahead of him; 0: as far as messages are kept.
    """

    experiment: Experiment
    start_s_m: float = 0.0
    duration_s: float = 0.0
    epoch_ns: int = 0
    sample_rate_hz: float = 0.0
    real_time_factor: float = 0.0
    listener: str = ''
    ahead_s: float = 0.0


@dataclass(frozen=True)
class Batch:
    """Consecutive samples of a run.

    Attributes
    ----------
    first : int
        Index of the first row since the run's start.
    stamp_ns : (n,) int64
    columns : (n, k) float64
        One column a sensor, SI.
    place_m : (n,) float64
        Path coordinate of axle 0, within one loop.
    rate_hz : float
    """

    first: int
    stamp_ns: Nanoseconds
    columns: Floats
    place_m: Floats
    rate_hz: float


@dataclass
class Run:
    """An experiment in progress."""

    order: Order
    simulation: AnySimulation
    rate_hz: float
    total_steps: int | None
    steps: int = 0
    rows: int = 0
    is_paused: bool = False
    heard_ns: int | None = None
    heard_wall: float = field(default_factory=time.monotonic)
    anchor_wall: float = field(default_factory=time.monotonic)
    anchor_s: float = 0.0
    is_paced: bool = True
    marks: list[tuple[float, float]] = field(default_factory=list)

    @property
    def time_s(self) -> float:
        return self.steps * self.simulation.step_s

    @property
    def time_ns(self) -> int:
        """Simulated time as it is in stamps."""
        return self.order.epoch_ns + round(self.time_s * NS)

    @property
    def is_done(self) -> bool:
        return self.total_steps is not None and self.steps >= self.total_steps

    @property
    def stride(self) -> int:
        return max(1, round(1.0 / (self.rate_hz * self.simulation.step_s)))

    @property
    def n_samples(self) -> int:
        return 0 if self.total_steps is None else -(-self.total_steps // self.stride)

    def anchor(self) -> None:
        """Let the pace begin at the present state."""
        self.anchor_wall, self.anchor_s = time.monotonic(), self.time_s
        self.marks = []

    def mark(self) -> None:
        """Note how far the run is, for the real-time factor."""
        now = time.monotonic()
        self.marks.append((now, self.time_s))
        while len(self.marks) > 2 and now - self.marks[1][0] > ACHIEVED_S:
            del self.marks[0]

    def achieved(self) -> float:
        """Return the real-time factor of the last seconds."""
        if len(self.marks) < 2:
            return 0.0
        (wall_0, time_0), (wall_1, time_1) = self.marks[0], self.marks[-1]
        return (time_1 - time_0) / max(wall_1 - wall_0, 1e-9)

    def advance(self, n_steps: int, sensors: tuple[Sensor, ...]) -> Batch | None:
        """Compute steps; return the samples among them, where there are any."""
        step_s = self.simulation.step_s
        if self.total_steps is not None:
            n_steps = min(n_steps, self.total_steps - self.steps)
        before = min(-self.steps % self.stride, n_steps)  # to the next sample, after single steps
        if before:
            self.simulation.trace(before * step_s, self.rate_hz, ())
            self.steps += before
            n_steps -= before
        if not n_steps:
            return None
        trace = self.simulation.trace(n_steps * step_s, self.rate_hz, sensors)
        index = self.rows + np.arange(len(trace.columns))
        stamps = self.order.epoch_ns + np.round(index * (NS / self.rate_hz)).astype(np.int64)
        place = trace.place_m % self.simulation.path.length_m
        batch = Batch(self.rows, stamps, trace.columns, place, self.rate_hz)
        self.steps += n_steps
        self.rows += len(index)
        return batch


def record_rate(machine: Machine, asked_hz: float, step_s: float) -> float:
    """Return the rate at which the model is read: one that every topic's rate divides.

    Raises
    ------
    ExperimentError
        Where the time step does not allow the rate that was asked for.
    """
    finest = 1.0 / step_s
    if asked_hz:
        if not 0.0 < asked_hz <= finest or abs(finest / asked_hz % 1.0) > 1e-9:
            raise ExperimentError(
                f'sample_rate: expected a whole part of {finest:g} Hz, found {asked_hz!r}'
            )
        return asked_hz
    rates = {sensor.rate_hz for sensor in sensors_of(machine)}
    return RATE_HZ if all(RATE_HZ % rate == 0.0 for rate in rates) else finest
