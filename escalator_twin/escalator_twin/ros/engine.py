"""The simulated run: a thread that computes ahead in chunks, keeps pace and waits for listeners.

No ROS here: what is computed goes to a function that the node gives.
"""

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import replace
import queue
import threading
import time
from typing import Any

from escalator_twin.errors import EscalatorError, ExperimentError
from escalator_twin.machine import Machine
from escalator_twin.ros.outputs import NS, sensors_of
from escalator_twin.ros.run import Batch, Order, record_rate, Run
from escalator_twin.ros.worker import CLOSING_S
from escalator_twin.twin import make_simulation

CHUNK_WALL_S = 0.02  # computed at once, in wall time
LONGEST_CHUNK_S = 0.2  # in simulated time
SILENCE_S = 20.0  # after which a listener that is waited for counts as gone


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
        self._sensors = sensors_of(machine)  # of the present run
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
        self.join(CLOSING_S)

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
        self._sensors = sensors_of(self.machine)
        self.trouble = ''
        return self.run_now

    def take_over(self, machine: Machine) -> None:
        """Have another machine from the next start; the present run stays what it is."""
        self.machine = machine

    def pause(self, is_paused: bool) -> None:
        """Stop or go on."""
        run = self.present()
        run.is_paused = is_paused
        run.anchor()

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
        run.anchor()
        return run

    def set_pace(self, real_time_factor: float) -> None:
        """Change the real-time factor that holds where a run has none of its own."""
        self.real_time_factor = real_time_factor
        if self.run_now is not None:
            self.run_now.anchor()

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
            # what is published after the end is nobody's
            self.failure = None if self._closing.is_set() else failure

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

    def _chunk_steps(self, run: Run) -> int:
        """Return how many steps to compute at once: whole samples."""
        pace = self.pace_of(run)
        chunk_s = min(CHUNK_WALL_S * pace, LONGEST_CHUNK_S) if pace else LONGEST_CHUNK_S
        period_s = run.stride * run.simulation.step_s
        return max(1, round(chunk_s / period_s)) * run.stride

    def _advance(self, run: Run, n_steps: int) -> None:
        """Compute and hand on."""
        batch = run.advance(n_steps, self._sensors)
        if batch is not None:
            self._emit(batch, run)
        run.mark()

    def present(self) -> Run:
        """Return the run in progress; raise an ExperimentError where there is none."""
        if self.run_now is None:
            raise ExperimentError('no experiment has been started')
        return self.run_now
