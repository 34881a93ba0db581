"""A recording of a machine of free bodies, placed, and what every cause would do to it."""

from collections.abc import Callable, Container, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from math import pi

import numpy as np

from escalator_twin.causes.application import apply
from escalator_twin.comparison.judge import judge
from escalator_twin.comparison.locate import locate, Setting
from escalator_twin.diagnosis.bodies.everywhere import Everywhere, run_everywhere
from escalator_twin.diagnosis.bodies.gears import off_gears
from escalator_twin.diagnosis.bodies.running import HANDRAIL, part_of, Runs
from escalator_twin.diagnosis.bodies.stage import BodyStage
from escalator_twin.diagnosis.context import Beside, Context
from escalator_twin.diagnosis.floor import Floor
from escalator_twin.diagnosis.free import of_machine
from escalator_twin.diagnosis.grids import Frame, Loop
from escalator_twin.diagnosis.knobs import knobs_of
from escalator_twin.diagnosis.nuisance import nuisance_of
from escalator_twin.diagnosis.observation import observe, on_grid
from escalator_twin.diagnosis.polish import Polished
from escalator_twin.diagnosis.preparation import start_in
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.responses import Responses
from escalator_twin.diagnosis.search_whole import LIKE_KNOBS
from escalator_twin.diagnosis.view import NO_PROBES, View
from escalator_twin.diagnosis.whitening import make_whitener
from escalator_twin.machine import Deviation, Machine, Sensor
from escalator_twin.physics.course import course_of
from escalator_twin.physics.rollout import Trace
from escalator_twin.signals import Experiment, Recording
from escalator_twin.sync.template import Template

Progress = Callable[[float, float], None]

# Causes without an index, each run once at about its reference beside the recording.
WHOLE: dict[str, tuple[Deviation, float]] = {
    'tensioner_friction': (Deviation('tensioner_friction', {'force_N': 150.0}), 150.0),
    'chain_elongation': (
        Deviation('chain_elongation', {'length_m': 1.5e-4}, {'side': 'both'}), 1.5e-4,
    ),
    'gear_eccentricity/cos': (
        Deviation(
            'gear_eccentricity', {'amplitude_m': 1e-3, 'phase_rad': 0.0}, {'which': 'upper'}
        ),
        1e-3,
    ),
    'gear_eccentricity/sin': (
        Deviation(
            'gear_eccentricity', {'amplitude_m': 1e-3, 'phase_rad': 0.5 * pi}, {'which': 'upper'}
        ),
        1e-3,
    ),
    'handrail_drag': (Deviation('handrail_drag', {'force_N': 150.0}), 150.0),
}  # fmt: skip
# Causes at every index, run once at index 0.
PLACES: dict[str, tuple[Deviation, float]] = {
    'roller_drag': (
        Deviation('roller_drag', {'force_N': 120.0}, {'axle': 0, 'side': 'both'}), 120.0,
    ),
    'link_elongation': (Deviation('link_elongation', {'length_m': 5e-4}, {'link': 0}), 5e-4),
}  # fmt: skip
LEAN = 'lean/'  # before a cause's name: the nuisance that the twin's own error is like
# contracts.md: means of link force, tensioner and acceleration are zeros of instruments
ZEROS = ('link_force', 'carriage_displacement', 'step_acceleration')


@dataclass(frozen=True, kw_only=True)
class BodyContext(Context):
    """A context whose responses were run beside the recording.

    Attributes
    ----------
    runs : Runs
    base : Trace
        The machine as described.
    knobs : mapping of tolerance to Trace
        The machine with one standard deviation of it.
    whole : mapping of name in ``WHOLE`` to Trace
    places : mapping of cause in ``PLACES`` to (n_loop, k) float32
        Change per unit of size, the cause at index 0.
    loops : mapping of cause, or '' for none, to Everywhere
        The runs that these come from.
    blocks : mapping of channel to slice
        Columns of ``places``.
    """

    runs: Runs
    base: Trace
    knobs: Mapping[str, Trace]
    whole: Mapping[str, Trace]
    places: Mapping[str, np.ndarray]
    loops: Mapping[str, Everywhere]
    blocks: dict[str, slice]


def prepare(
    recording: Recording,
    machine: Machine,
    floor: Floor,
    jobs: int = 1,
    progress: Progress | None = None,
    causes: bool = True,
    known: Mapping[str, Everywhere] | None = None,
) -> BodyContext:
    """Place a recording and run every tolerance, and every cause, once.

    Parameters
    ----------
    recording : Recording
    machine : Machine
    floor : Floor
    jobs : int
        Simulations at a time.
    progress : callable, optional
        Gets (done, total) in simulations.
    causes : bool
        Otherwise only what tolerances do.
    known : mapping of cause to Everywhere, optional
        ``loops`` of another recording at about the same speed: along travel they are alike.

    Raises
    ------
    RecordingError, SynchronisationError
        Where the recording cannot be placed.
    """
    length = course_of(machine).length_m
    loops: list[Everywhere] = []

    def make_loop(machine: Machine, experiment: Experiment) -> Template:
        loops.append(run_everywhere(machine, experiment, length))
        return loops[-1].template(machine)

    setting = locate(recording, machine, make_loop=make_loop)
    frame = Frame.of(machine, loops[-1].speed_m_s)
    runs = Runs(setting)
    tasks = _tasks(machine, setting, runs, loops[-1], causes)
    if known is not None:
        tasks = {(kind, name): task for (kind, name), task in tasks.items() if kind != 'place'}
    found = _run(tasks, jobs, progress)
    laps = {'': loops[-1]} if known is None else dict(known)
    laps |= {name: run for (_, name), run in found.items() if isinstance(run, Everywhere)}
    direction = setting.experiment.direction
    base = Loop(
        loops[-1].on_loop(frame), loops[-1].place_on(frame, length), length * direction, 0.0
    )
    empty = np.zeros((0, 0), np.complex64)
    responses = Responses(
        frame, base, {}, {}, {}, empty, {}, {}, machine.roller.diameter_m / 2.0
    )  # fmt: skip
    places = {
        name: (lap.on_loop(frame) - laps[''].on_loop(frame)) / np.float32(PLACES[name][1])
        for name, lap in laps.items()
        if name
    }
    context = BodyContext(
        recording, machine, setting, responses, floor, start_in(setting, responses),
        runs=runs, base=_trace(found['base', '']),
        knobs={name: _trace(run) for (kind, name), run in found.items() if kind == 'knob'},
        whole={name: _trace(run) for (kind, name), run in found.items() if kind == 'whole'},
        places=places, loops=laps, blocks=loops[-1].blocks,
    )  # fmt: skip
    return replace(context, place=aligned(context, machine, context.base))


Task = Callable[[], 'Trace | Everywhere']


def _trace(run: 'Trace | Everywhere') -> Trace:
    assert isinstance(run, Trace)
    return run


def _tasks(
    machine: Machine, setting: Setting, runs: Runs, loop: Everywhere, causes: bool
) -> dict[tuple[str, str], Task]:
    """Return all simulations of a recording, by kind and name."""
    experiment = setting.experiment
    tasks: dict[tuple[str, str], Task] = {('base', ''): lambda: runs.trace(machine)}

    def knob_task(name: str) -> Task:
        knob = next(k for k in knobs_of(machine, experiment) if k.name == name)

        def work() -> Trace:
            turned, other = knob.turn(machine, experiment, 1.0)
            return runs.trace(turned, other)

        return work

    for knob in knobs_of(machine, experiment):
        tasks['knob', knob.name] = knob_task(knob.name)
    if not causes:
        return tasks
    rail = any(part_of(s) == HANDRAIL for s in machine.instruments.sensors)
    for name, (deviation, _) in WHOLE.items():
        if name != 'handrail_drag' or rail:
            tasks['whole', name] = partial(_deviated, runs, machine, deviation)
    length = course_of(machine).length_m
    at = replace(experiment, set_speed_m_s=loop.speed_m_s)
    for name, (deviation, _) in PLACES.items():
        tasks['place', name] = partial(run_everywhere, machine, at, length, (deviation,))
    return tasks


def _deviated(runs: Runs, machine: Machine, deviation: Deviation) -> Trace:
    return runs.trace(apply(machine, (deviation,)))


def _run(
    tasks: dict[tuple[str, str], Task], jobs: int, progress: Progress | None
) -> 'dict[tuple[str, str], Trace | Everywhere]':
    """Run simulations in threads: the compiled loop holds no interpreter lock."""
    found = {}
    first, *rest = tasks  # the first compiles, and runs the handrail that the others share
    found[first] = tasks[first]()
    with ThreadPoolExecutor(max(1, jobs)) as pool:
        for name, run in zip(rest, pool.map(lambda n: tasks[n](), rest), strict=True):
            found[name] = run
            if progress is not None:
                progress(len(found), len(tasks))
    return found


def aligned(
    context: BodyContext, machine: Machine, trace: Trace, without: Container[str] = ()
) -> Beside:
    """Align a recording with a run, and fit what it leaves.

    ``without`` names the tolerances that are no nuisance: an effect is their size.
    """
    setting = context.setting
    speed = setting.experiment.set_speed_m_s
    judgement = judge(setting, trace, machine, with_scores=False)
    observation = observe(setting, judgement, machine, context.frame, context.start_m)
    view = View(observation, context.responses, setting.experiment.direction, NO_PROBES)
    valid = off_gears(observation, view.place_of(0), machine)
    observation = replace(observation, valid=valid)
    columns = {s.channel: i for i, s in enumerate(machine.instruments.sensors)}
    model = on_grid(trace, speed, observation, columns)
    base = on_grid(context.base, speed, observation, columns)
    knobs = {
        name: on_grid(turned, speed, observation, columns) - base
        for name, turned in context.knobs.items()
        if name not in without
    }
    leans = lean_spreads(context.floor, machine)
    for cause, sd in leans.items():
        name = nuisance_name(cause)
        if name in knobs:
            knobs[name] = knobs[name] * (sd / machine.tolerances[name])
        elif cause in context.whole and name not in without:
            lean = on_grid(context.whole[cause], speed, observation, columns) - base
            knobs[name] = lean * (sd / WHOLE[cause][1])
    sensors = [machine.instruments.sensor(channel) for channel in observation.channels]
    above, zeros = {}, {}
    for k, sensor in enumerate(sensors):
        known = context.floor.mean_of(sensor, speed)
        if known is not None and sensor.quantity not in ZEROS:
            above[sensor.channel] = known[0]
            zeros[sensor.channel] = mean_spread(sensor, known[1], float(model[:, k].mean()))
    nuisance = nuisance_of(observation, model, knobs, machine, zeros)
    whiten = make_whitener(observation, machine, context.floor, zeros)
    stage = BodyStage(
        machine, setting, observation, nuisance, whiten, whiten(nuisance.columns),
        knobs_of(machine, setting.experiment), {}, trace.rack_m, runs=context.runs, above=above,
        leans={nuisance_name(cause): (cause, sd) for cause, sd in leans.items()},
    )  # fmt: skip
    return Beside(stage, judgement, model, stage.fit(model))


def nuisance_name(cause: str) -> str:
    """Return the name of the nuisance that a cause of this kind of machine stands for."""
    return LIKE_KNOBS[cause][0] if cause in LIKE_KNOBS else LEAN + cause


def lean_spreads(floor: Floor, machine: Machine) -> dict[str, float]:
    """Return what good machines seem to have of causes that the twin's own error is like.

    Returns
    -------
    spread : mapping of cause to float
        One standard deviation of its size, no less than the tolerance.
    """
    return {
        cause: max(sd, machine.tolerances.get(nuisance_name(cause), 0.0))
        for cause, sd in floor.leans.items()
    }


def mean_spread(sensor: Sensor, scatter: float, mean: float) -> float:
    """Return one standard deviation of the mean of a channel in good machines, SI.

    ``scatter`` was measured on recordings, the zeros of their instruments in it.
    """
    zero = sensor.zero * abs(sensor.scale) / 3.0**0.5  # drawn evenly up to the largest
    return float(np.hypot(max(scatter, zero), sensor.gain_tol * mean))


def again(context: Context, place: Beside, known: Sequence[Proposal], jobs: int = 1) -> Polished:
    """Run a machine with its known effects and align the recording with it."""
    del place, jobs  # tolerances stay linear here
    assert isinstance(context, BodyContext)
    deviations = tuple(k.deviation for k in known if of_machine(k))
    machine = apply(context.machine, deviations)
    without = {nuisance_name(d.cause) for d in deviations}
    return Polished(
        context, aligned(context, machine, context.runs.trace(machine), without), (), ()
    )
