"""Many simulations on all cores: one thread each, since the compiled loop needs no interpreter.

Threads share the compiled code and the machine; a process for each core would first import and
load all of it again (about two seconds), and gains nothing: the loop runs without Python's lock.
"""

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import product
import os
from threading import Lock

from escalator_twin.machine import Machine, Sensor
from escalator_twin.physics.rollout import STEP_S, Trace
from escalator_twin.signals import Experiment
from escalator_twin.twin import make_simulation, run_twin

RATE_HZ = 200.0

Progress = Callable[[float, float], None]


@dataclass(frozen=True)
class Run:
    """One simulation of a batch.

    Attributes
    ----------
    start_s_m : float
        Path coordinate of axle 0 at the first sample, m.
    rate_hz : float
        Of the record; must divide the step rate.
    """

    machine: Machine
    experiment: Experiment
    sensors: tuple[Sensor, ...]
    start_s_m: float
    duration_s: float
    rate_hz: float = RATE_HZ
    planar: bool = False
    step_s: float = STEP_S


def run_batch(
    runs: Iterable[Run], jobs: int | None = None, progress: Progress | None = None
) -> list[Trace]:
    """Simulate many runs; the results stand in the order of the runs, whatever ended first.

    Parameters
    ----------
    runs : iterable of Run
        Each on its own.
    jobs : int, optional
        How many at a time; by default one per core that this process may use.
    progress : callable, optional
        Gets (done, total) in simulated seconds, from any thread, one at a time.
    """
    runs = list(runs)
    total = sum(run.duration_s for run in runs)
    lock, done = Lock(), 0.0

    def count(seconds: float) -> None:
        nonlocal done
        with lock:
            done += seconds
            if progress is not None:
                progress(done, total)

    def simulate(run: Run) -> Trace:
        before = 0.0

        def report(now: float, _total: float) -> None:
            nonlocal before
            count(now - before)
            before = now

        simulation = make_simulation(run.machine, run.experiment, run.planar, run.step_s)
        return run_twin(
            simulation, run.sensors, run.start_s_m, run.duration_s, run.rate_hz, report
        )

    with ThreadPoolExecutor(max_workers=jobs or usable_cores()) as pool:
        return list(pool.map(simulate, runs))


def usable_cores() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, 'sched_getaffinity'):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def full_factorial(
    machine: Machine,
    speeds_m_s: Sequence[float] = (0.25, 0.5),
    loads_kg: Sequence[float] = (0.0, 75.0),
    preloads_n: Sequence[float] = (3000.0, 6000.0),
) -> list[Experiment]:
    """Return the experiment plan of the prototype: all cases of four factors at two levels."""
    return [
        Experiment(speed, direction, (load,), preload, machine=machine.name)
        for speed, direction, load, preload in product(speeds_m_s, (1, -1), loads_kg, preloads_n)
    ]
