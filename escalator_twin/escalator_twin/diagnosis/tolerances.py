"""What every tolerance does to the signals of one experiment, per loop."""

from collections.abc import Callable, Container
from dataclasses import replace

import numpy as np

from escalator_twin.diagnosis.floor import is_shaken
from escalator_twin.diagnosis.grids import Frame, Origin
from escalator_twin.diagnosis.knobs import Knob, knobs_of
from escalator_twin.diagnosis.loops import sensor_probes, simulate_loop
from escalator_twin.diagnosis.rails import rail_columns
from escalator_twin.diagnosis.simultaneous import run_all
from escalator_twin.machine import Machine
from escalator_twin.signals import Experiment

Columns = np.ndarray  # float32

RAIL = 'rail/'  # before the number of a direction of `rail_columns`, beside the tolerances' names
WANDER = 'wander'  # among the tolerances: what a share of the drive's speed does
WANDER_STEP = 0.004  # of the speed: twice the largest wander of a good drive
KNOB_STEP = 2.0  # standard deviations: far above what rattling rollers make of any change


def find_knobs(
    machine: Machine,
    experiment: Experiment,
    speed_m_s: float,
    jobs: int = 1,
    left_out: Container[str] = (),
    step: float = KNOB_STEP,
    with_rails: bool = True,
    origin: Origin = None,
) -> dict[str, Columns]:
    """Simulate one loop for every tolerance of a machine with its deviations, for its rail and its speed.

    A deviation that moves a resonance changes what the tolerances do. ``step``, in standard
    deviations, is the tolerances' difference; ``origin`` is that of travel, see `simulate_loop`.
    """
    frame = Frame.of(machine, speed_m_s)
    experiment = replace(experiment, set_speed_m_s=speed_m_s)
    seen = sensor_probes(machine.instruments.sensors, machine.chain.n_links)
    base = simulate_loop(machine, experiment, frame, seen, origin=origin)
    shaken = [is_shaken(sensor) for sensor in machine.instruments.sensors]

    def task(knob: Knob) -> Callable[[], Columns]:
        def work() -> Columns:
            turned, setting = knob.turn(machine, experiment, step)
            loop = simulate_loop(turned, setting, frame, seen, (), base.rack_m)
            change: Columns = (loop.columns - base.columns) / np.float32(step)
            change[:, shaken] = 0.0
            return change

        return work

    def at(share: float) -> Callable[[], Columns]:
        def work() -> Columns:
            faster = replace(frame, speed_m_s=speed_m_s * (1.0 + share))
            setting = replace(experiment, set_speed_m_s=faster.speed_m_s)
            return simulate_loop(machine, setting, faster, seen, (), base.rack_m).columns

        return work

    knobs = [knob for knob in knobs_of(machine, experiment) if knob.name not in left_out]
    tasks: dict[object, Callable[[], Columns]] = {knob.name: task(knob) for knob in knobs}
    tasks |= {f'{WANDER}/{way}': at(way * WANDER_STEP) for way in (-1, 1)}
    found = run_all(tasks, jobs, None)
    columns = {knob.name: found[knob.name] for knob in knobs}
    hurried = (found[f'{WANDER}/1'] - found[f'{WANDER}/-1']) / np.float32(2.0 * WANDER_STEP)
    hurried[:, shaken] = 0.0
    columns[WANDER] = hurried
    if not with_rails:
        return columns
    rails = rail_columns(machine, experiment, frame, jobs, base.rack_m)
    return {
        **columns,
        **{f'{RAIL}{k}': rails[:, :, k] for k in range(rails.shape[2])},
    }
