"""The simulated run: a thread that computes ahead in chunks, keeps pace and waits for listeners.

No ROS here: what is computed goes to a function that the node gives.
"""

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field, replace
import queue
import threading
import time
from typing import Any

import numpy as np

from escalator_twin.comparison.locate import RATE_HZ
from escalator_twin.errors import EscalatorError, ExperimentError
from escalator_twin.machine import Machine
from escalator_twin.physics.rollout import Simulation
from escalator_twin.ros.outputs import NS, sensors_of
from escalator_twin.signals import Experiment, Floats, Nanoseconds
from escalator_twin.twin import make_simulation

CHUNK_WALL_S = 0.02  # computed at once, in wall time
LONGEST_CHUNK_S = 0.2  # in simulated time
SILENCE_S = 20.0  # after which a listener that is waited for counts as gone
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
    simulation: Simulation
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


class Engine(threading.Thread):
    """Runs experiments one after the other; commands are carried out between two chunks.

    Parameters
    ----------
    machine : Machine
    emit : callable
        Gets each `Batch` and its `Run`, in this thread.
    ahead_s : float
        How much simulated time a listener may be behind.
    real_time_factor : float
        0: as fast as possible.
    """

    def __init__(
        self,
        machine: Machine,
        emit: Callable[[Batch, 'Run'], None],
        ahead_s: float,
        real_time_factor: float,
    ) -> None:
        super().__init__(name='simulation', daemon=True)
        self.machine, self.ahead_s = machine, ahead_s
        self.real_time_factor = real_time_factor
        self.run_now: Run | None = None
        self.trouble = ''
        self.failure: BaseException | None = None
        self._emit = emit
        self._commands: queue.Queue[tuple[Callable[[], Any], Future[Any]]] = queue.Queue()
        self._closing = threading.Event()

    # from other threads

    def submit(self, command: Callable[[], Any]) -> 'Future[Any]':
        """Have a command carried out between two chunks."""
        future: Future[Any] = Future()
        self._commands.put((command, future))
        return future

    def close(self) -> None:
        """End the thread."""
        self._closing.set()
        self.submit(lambda: None)
        self.join()

    def heard(self, listener: str, stamp_ns: int) -> None:
        """Note how far a listener has heard."""
        run = self.run_now
        if run is not None and listener == run.order.listener:
            run.heard_ns = max(stamp_ns, run.heard_ns or stamp_ns)
            run.heard_wall = time.monotonic()
            self.submit(lambda: None)

    # commands

    def start_run(self, order: Order) -> Run:
        """Replace the present run by another one, in static equilibrium at its place, at speed."""
        simulation = make_simulation(self.machine, order.experiment)
        rate = record_rate(self.machine, order.sample_rate_hz, simulation.step_s)
        simulation.start(order.start_s_m)
        steps = round(order.duration_s / simulation.step_s) if order.duration_s else None
        self.run_now = Run(order, simulation, rate, steps)
        self.trouble = ''
        return self.run_now

    def pause(self, is_paused: bool) -> None:
        """Stop or go on."""
        run = self.present()
        run.is_paused = is_paused
        _anchor(run)

    def step(self, duration_s: float, n_steps: int) -> Run:
        """Advance a paused run by a time, or by time steps where that is 0."""
        run = self.present()
        if not 0.0 <= duration_s < 1e6 or (duration_s == 0.0 and n_steps == 0):
            raise ExperimentError(f'duration: expected more than 0 s, found {duration_s!r}')
        n_steps = round(duration_s / run.simulation.step_s) or n_steps
        if not run.is_paused:
            raise ExperimentError('step: the simulation is running: pause it first')
        if run.is_done:
            raise ExperimentError(f'step: the experiment ended at {run.time_s:.3f} s: reset it')
        while n_steps > 0 and not run.is_done:
            part = min(n_steps, round(LONGEST_CHUNK_S / run.simulation.step_s))
            self._advance(run, part)
            n_steps -= part
        _anchor(run)
        return run

    def set_pace(self, real_time_factor: float) -> None:
        """Change the real-time factor that holds where a run has none of its own."""
        self.real_time_factor = real_time_factor
        if self.run_now is not None:
            _anchor(self.run_now)

    # the thread

    def run(self) -> None:
        """Carry out commands and compute until closed."""
        try:
            while not self._closing.is_set():
                wait_s = self._wait_s()
                while self._serve(wait_s):
                    wait_s = 0.0
                if self.run_now is not None and self._wait_s() == 0.0:
                    self._compute(self.run_now)
        except BaseException as failure:
            self.failure = failure
            raise

    def _compute(self, run: Run) -> None:
        """Compute the next chunk."""
        try:
            self._advance(run, self._chunk_steps(run))
        except EscalatorError as error:
            self.trouble = str(error)
            self.run_now = None

    def _serve(self, wait_s: float) -> bool:
        """Carry out one command; wait for it as long as that. Tell whether there was one."""
        try:
            command, future = self._commands.get(block=wait_s > 0.0, timeout=wait_s or None)
        except queue.Empty:
            return False
        try:
            future.set_result(command())
        except EscalatorError as error:
            future.set_exception(error)
        return True

    def _wait_s(self) -> float:
        """Return how long nothing is to be computed, s."""
        run = self.run_now
        if run is None or run.is_paused or run.is_done:
            return 1.0
        if self._is_held(run):
            return 0.2
        pace = self.pace_of(run)
        run.is_paced = pace > 0.0
        if not pace:
            return 0.0
        due = run.anchor_s + pace * (time.monotonic() - run.anchor_wall)
        return max(0.0, (run.time_s - due) / pace)

    def _is_held(self, run: Run) -> bool:
        """Tell whether the run waits for its listener."""
        if not run.order.listener:
            return False
        heard_s = ((run.heard_ns or run.order.epoch_ns) - run.order.epoch_ns) / NS
        if run.time_s < heard_s + min(run.order.ahead_s or self.ahead_s, self.ahead_s):
            return False
        if time.monotonic() - run.heard_wall > SILENCE_S:
            self.trouble = f'{run.order.listener} has not been heard of for {SILENCE_S:.0f} s'
            run.order = replace(run.order, listener='')
            return False
        return True

    def pace_of(self, run: Run) -> float:
        """Return a run's real-time factor, 0 where it is as fast as possible."""
        asked = run.order.real_time_factor
        return self.real_time_factor if asked == 0.0 else max(asked, 0.0)

    def achieved(self) -> float:
        """Return the real-time factor of the last seconds."""
        run = self.run_now
        if run is None or len(run.marks) < 2:
            return 0.0
        (wall_0, time_0), (wall_1, time_1) = run.marks[0], run.marks[-1]
        return (time_1 - time_0) / max(wall_1 - wall_0, 1e-9)

    def _chunk_steps(self, run: Run) -> int:
        """Return how many steps to compute at once: whole samples."""
        pace = self.pace_of(run)
        chunk_s = min(CHUNK_WALL_S * pace, LONGEST_CHUNK_S) if pace else LONGEST_CHUNK_S
        period_s = run.stride * run.simulation.step_s
        return max(1, round(chunk_s / period_s)) * run.stride

    def _advance(self, run: Run, n_steps: int) -> None:
        """Compute and hand on; the first row is at the present state, if that is a sample's."""
        step_s = run.simulation.step_s
        if run.total_steps is not None:
            n_steps = min(n_steps, run.total_steps - run.steps)
        ahead = -run.steps % run.stride  # steps to the next sample, after single steps
        if ahead:
            run.simulation.trace(min(ahead, n_steps) * step_s, run.rate_hz, ())
            run.steps += min(ahead, n_steps)
            n_steps -= min(ahead, n_steps)
        if n_steps:
            trace = run.simulation.trace(n_steps * step_s, run.rate_hz, sensors_of(self.machine))
            index = run.rows + np.arange(len(trace.columns))
            stamps = run.order.epoch_ns + np.round(index * (NS / run.rate_hz)).astype(np.int64)
            place = trace.place_m % run.simulation.path.length_m
            run.steps += n_steps
            batch = Batch(run.rows, stamps, trace.columns, place, run.rate_hz)
            run.rows += len(trace.columns)
            self._emit(batch, run)
        now = time.monotonic()
        run.marks.append((now, run.time_s))
        while len(run.marks) > 2 and now - run.marks[1][0] > ACHIEVED_S:
            del run.marks[0]

    def present(self) -> Run:
        """Return the run in progress; raise an ExperimentError where there is none."""
        if self.run_now is None:
            raise ExperimentError('no experiment has been started')
        return self.run_now


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


def _anchor(run: Run) -> None:
    """Let the pace begin at the present state."""
    run.anchor_wall, run.anchor_s = time.monotonic(), run.time_s
    run.marks = []
