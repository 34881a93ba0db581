"""What every tolerance and every cause does to the signals of one experiment, per loop."""

from collections.abc import Callable, Container, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from math import ceil, pi
from typing import TypeVar

import numpy as np

from escalator_twin.diagnosis.floor import is_shaken, SHAKING
from escalator_twin.diagnosis.knobs import Knob, knobs_of
from escalator_twin.diagnosis.loops import (
    all_probes,
    Frame,
    Loop,
    Origin,
    sensor_probes,
    simulate_loop,
)
from escalator_twin.diagnosis.rails import rail_columns
from escalator_twin.machine import Deviation, Machine
from escalator_twin.physics import run
from escalator_twin.signals import Experiment, Floats

Columns = np.ndarray  # float32
Ran = TypeVar('Ran')  # what a simulation is for
Progress = Callable[[float, float], None]

RAIL = 'rail/'  # before the number of a direction of `rail_columns`, beside the tolerances' names
WANDER = 'wander'  # among the tolerances: what a share of the drive's speed does
WANDER_STEP = 0.004  # of the speed: twice the largest wander of a good drive
KNOB_STEP = 2.0  # standard deviations: far above what rattling rollers make of any change
STOP_SHARES = (0.2, 0.5, 0.8)  # of the carriage's motion above its mean
# Sizes at which a cause's response is taken: the reference of contracts.md, or half of it where
# the reference is far from linear and smaller effects are asked for too.
ALL_PLACES: dict[str, tuple[Deviation, float]] = {
    'link_elongation': (Deviation('link_elongation', {'length_m': 3e-3}, {'link': 0}), 3e-3),
    'link_stiffness': (
        Deviation('link_stiffness', {'factor': 0.5}, {'link': 0, 'side': 'left'}),
        1.0,
    ),
    'roller_drag': (
        Deviation('roller_drag', {'force_N': 120.0}, {'axle': 0, 'side': 'left'}),
        120.0,
    ),
    'load_distribution': (
        Deviation('load_distribution', {'load_factor': 0.0}, {'steps': [0]}),
        -1.0,
    ),
    'step_mass': (Deviation('step_mass', {'delta_kg': 18.0}, {'step': 0}), 18.0),
}
WHOLE: dict[str, tuple[Deviation, float]] = {
    'tensioner_friction': (Deviation('tensioner_friction', {'force_N': 100.0}), 100.0),
    'chain_elongation': (
        Deviation('chain_elongation', {'length_m': 1.5e-4}, {'side': 'left'}),
        1.5e-4,
    ),
    'load_offset': (Deviation('load_offset', {'left_share': 0.6}), 0.1),
}
# Where a small change says little about a large one: springs near a resonance, and whatever moves
# the carriage by a good part of a pitch's polygon.
FAR: tuple[tuple[str, str, float], ...] = (
    ('tensioner_stiffness', 'factor', 1.4),
    ('tensioner_stiffness', 'factor', 0.7),
    ('tensioner_preload', 'factor', 1.25),
    ('tensioner_preload', 'factor', 0.8),
    ('drive_stiffness', 'factor', 0.25),
    ('rolling_resistance', 'factor', 1.6),
    ('rolling_resistance', 'factor', 0.6),
    ('landing_length', 'delta_m', 6e-3),
    ('landing_length', 'delta_m', -6e-3),
)
ECCENTRICITY_M, FLAT_M = 4e-4, 6e-4
# Along the tread between the phases at which a flat spot is run. What it does changes slowly along the guide: told from
# 23 of 46 phases it was off by 7 % in amplitude at 0.26 m/s, from 12 of 24 at 0.5 m/s by 10 %.
SPOT_M = 0.0105


def _tread(cause: str, size: float, phase: float) -> Deviation:
    key = 'amplitude_m' if cause == 'roller_eccentricity' else 'depth_m'
    place: dict[str, object] = {'axle': 0, 'side': 'left'}
    return Deviation(cause, {key: size, 'phase_rad': phase}, place)


@dataclass(frozen=True)
class Responses:
    """All responses of one experiment at one speed.

    Attributes
    ----------
    frame : Frame
    base : Loop
        The machine of the data sheet, all places.
    knobs : mapping of name to (n_loop, c) float32
        Change of the machine's channels by one standard deviation of a tolerance; under ``WANDER`` by
        one of the drive's speed, as a share of it.
    whole : mapping of cause to (n_loop, 1 + 5 n) float32
        Change per unit of size of causes without an index.
    places : mapping of cause to (n_loop, 1 + 5 n) float32
        The same at index 0, on the left where there is a side.
    eccentric : (n_loop, 1 + 5 n) complex64
        Per metre, of a tread that varies as the real part of exp(i turn).
    far : mapping of (cause, parameter, value) to (n_loop, 1 + 5 n) float32
        Change by a large size.
    stops : mapping of displacement (m) to (n_loop, 1 + 5 n) float32
        Change by a stop there.
    radius_m : float
        Of the rollers.
    rolled_m : (n_loop + 1,) float64 or None
        Of axle 0, in the run behind ``eccentric``: see `Loop`.
    """

    frame: Frame
    base: Loop
    knobs: dict[str, Columns]
    whole: dict[str, Columns]
    places: dict[str, Columns]
    eccentric: Columns
    far: dict[tuple[str, str, float], Columns]
    stops: dict[float, Columns]
    radius_m: float
    rolled_m: Floats | None = None


def find_responses(
    machine: Machine,
    experiment: Experiment,
    knobs: dict[str, Columns],
    jobs: int = 1,
    progress: Progress | None = None,
    origin: Origin = None,
) -> Responses:
    """Simulate one loop for every cause.

    Parameters
    ----------
    machine : Machine
    experiment : Experiment
        ``set_speed_m_s`` is the real speed; a list of loads is taken as its mean.
    knobs : mapping of name to (n_loop, c) float32
        What the tolerances do, see ``find_knobs``.
    jobs : int
        Simulations at a time.
    progress : callable, optional
        Gets (done, total) in simulations.
    origin : float or Begin, optional
        Of travel, see `simulate_loop`.
    """
    frame = Frame.of(machine, experiment.set_speed_m_s)
    every = all_probes()
    base = simulate_loop(machine, experiment, frame, every, origin=origin)
    is_loaded = max(experiment.load_per_step_kg) > 0.0
    tasks: dict[object, Callable[[], Loop]] = {}

    def cause_task(deviation: Deviation, size: float) -> Callable[[], Loop]:
        return partial(_change, machine, experiment, base, frame, deviation, size)

    for name, (deviation, size) in {**ALL_PLACES, **WHOLE}.items():
        if name in ('load_distribution', 'load_offset') and not is_loaded:
            continue
        tasks[name] = cause_task(deviation, size)
    for k, phase in enumerate((0.5 * pi, 0.0)):
        tasks['eccentric', k] = cause_task(
            _tread('roller_eccentricity', ECCENTRICITY_M, phase), ECCENTRICITY_M
        )
    found = _run(tasks, jobs, progress)
    return Responses(
        frame,
        base,
        knobs,
        {name: found[name].columns for name in WHOLE if name in found},
        {name: found[name].columns for name in ALL_PLACES if name in found},
        found['eccentric', 0].columns + 1j * found['eccentric', 1].columns,
        {},
        {},
        machine.roller.diameter_m / 2.0,
        found['eccentric', 0].rolled_m,
    )


def _change(
    machine: Machine,
    experiment: Experiment,
    base: Loop,
    frame: Frame,
    deviation: Deviation,
    size: float = 1.0,
) -> Loop:
    """Simulate one loop with a deviation; return it with what that changes, over ``size``."""
    loop = simulate_loop(machine, experiment, frame, all_probes(), (deviation,), base.rack_m)
    change: Columns = (loop.columns - base.columns) / np.float32(size)
    if deviation.cause not in SHAKING:
        change[:, _shaken_columns(machine.chain.n_links)] = 0.0
    return replace(loop, columns=change)


def find_far(
    machine: Machine, experiment: Experiment, responses: Responses, jobs: int = 1
) -> Responses:
    """Simulate one loop for every cause whose small change says little about a large one.

    Parameters
    ----------
    machine : Machine
    experiment : Experiment
        At the responses' speed.
    responses : Responses
        Of the same machine: its loop without a cause.
    jobs : int

    Returns
    -------
    responses : Responses
        With ``far`` and ``stops``.
    """
    frame, base = responses.frame, responses.base
    stops = _stop_levels(base)
    tasks: dict[object, Callable[[], Loop]] = {}
    for key in FAR:
        name, parameter, value = key
        place: dict[str, object] = {'which': 'upper'} if name == 'landing_length' else {}
        deviation = Deviation(name, {parameter: value}, place)
        tasks[key] = partial(_change, machine, experiment, base, frame, deviation)
    for level in stops:
        deviation = Deviation('tensioner_stop', {'displacement_m': level})
        tasks[level] = partial(_change, machine, experiment, base, frame, deviation)
    found = _run(tasks, jobs, None)
    return replace(
        responses,
        far={key: found[key].columns for key in FAR},
        stops={level: found[level].columns for level in stops},
    )


def tolerances_only(
    machine: Machine, experiment: Experiment, jobs: int = 1, origin: Origin = None
) -> Responses:
    """Return responses with tolerances alone: all that fitting the nuisance needs."""
    speed = experiment.set_speed_m_s
    frame = Frame.of(machine, speed)
    base = simulate_loop(machine, experiment, frame, all_probes(), origin=origin)
    knobs = find_knobs(machine, experiment, speed, jobs, origin=base.rack_m)
    empty = np.zeros((0, 0), np.complex64)
    return Responses(
        frame, base, knobs, {}, {}, empty, {}, {}, machine.roller.diameter_m / 2.0
    )  # fmt: skip


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
    found = _run(tasks, jobs, None)
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


def find_flats(
    machine: Machine, experiment: Experiment, responses: Responses, jobs: int = 1
) -> tuple[Columns, Floats]:
    """Simulate one loop for a flat spot of the first roller at every phase.

    Parameters
    ----------
    machine : Machine
        With its tolerances turned.
    experiment : Experiment
    responses : Responses
        Whose grid is taken, and from where travel is counted.
    jobs : int
        Simulations at a time.

    Returns
    -------
    flats : (phases, n_loop, 1 + 5 n) float32
        Per metre of depth, for phases of 0 to 2 pi. A spot's blows ring the chain at many times the turn's
        frequency; fewer phases than the grid has points in a turn fold what it shows of that onto other orders:
        see `unfolded`.
    rolled : (n_loop + 1,) float64
        Way that the roller has rolled at the grid's points, see `Loop`.
    """
    frame, every = responses.frame, all_probes()
    experiment = replace(experiment, set_speed_m_s=frame.speed_m_s)
    rack = responses.base.rack_m
    # of this very machine: a difference of anything else would count as the spot's
    base = simulate_loop(machine, experiment, frame, every, (), rack)
    count = 2 * ceil(pi * responses.radius_m / max(frame.spacing_m, SPOT_M))
    tasks: dict[object, Callable[[], Loop]] = {
        k: partial(
            _change, machine, experiment, base, frame,
            _tread('roller_flat', FLAT_M, 2.0 * pi * k / count), FLAT_M,
        )
        for k in range(count)
    }  # fmt: skip
    found = _run(tasks, jobs, None)
    rolled = found[0].rolled_m
    assert rolled is not None, 'a machine with a flat spot is not the same after a pitch'
    return np.stack([found[k].columns for k in range(count)]), rolled


def _shaken_columns(n_links: int) -> list[int]:
    """Return where all steps' accelerations along x and z are, as ``all_probes`` orders them."""
    first = 1 + 2 * n_links
    return [first + axis * n_links + k for axis in (0, 2) for k in range(n_links)]


def _stop_levels(base: Loop) -> list[float]:
    """Return displacements of the carriage in the upper half of its motion, m."""
    motion = base.columns[:, 0]
    middle = 0.5 * float(motion.max() + motion.min())
    return [middle + share * (float(motion.max()) - middle) for share in STOP_SHARES]


def _run(
    tasks: Mapping[object, Callable[[], Ran]], jobs: int, progress: Progress | None
) -> dict[object, Ran]:
    """Run tasks on threads; the compiled loop runs without Python's lock."""
    done = 0
    found: dict[object, Ran] = {}
    with ThreadPoolExecutor(max(1, jobs)) as pool:
        futures = {key: pool.submit(task) for key, task in tasks.items()}
        for key, future in futures.items():
            found[key] = future.result()
            done += 1
            if progress is not None:
                progress(done, len(tasks))
    return found


def at_sensors(
    columns: Columns, probes: np.ndarray, n_links: int, index: int = 0, mirrored: bool = False
) -> Columns:
    """Pick what a machine's sensors see out of the columns of all places.

    Parameters
    ----------
    columns : (..., 1 + 5 n) float32
        As ``all_probes`` orders them, of a cause at index 0 on the left.
    probes : (c, 3) int64
        Of the sensors.
    n_links : int
    index : int
        Of the cause; the sensors then sit ``index`` places behind.
    mirrored : bool
        The cause sits on the right.
    """
    picked, sign = [], []
    for kind, at, side in probes:
        place = (at - index) % n_links
        sign.append(-1.0 if mirrored and kind == run.ACCEL_Y else 1.0)
        if kind == run.CARRIAGE:
            picked.append(0)
        elif kind == run.LINK_FORCE:
            picked.append(1 + (1 - side if mirrored else side) * n_links + place)
        else:
            axis = (run.ACCEL_X, run.ACCEL_Y, run.ACCEL_Z).index(kind)
            picked.append(1 + (2 + axis) * n_links + place)
    seen: Columns = columns[..., picked] * np.array(sign, np.float32)
    return seen
