"""What every cause does to the signals of one experiment, per loop."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from math import pi

import numpy as np

from escalator_twin.diagnosis.floor import SHAKING
from escalator_twin.diagnosis.grids import Frame, Loop, Origin
from escalator_twin.diagnosis.loops import all_probes, simulate_loop
from escalator_twin.diagnosis.simultaneous import Progress, run_all
from escalator_twin.diagnosis.tolerances import Columns, find_knobs
from escalator_twin.machine import Deviation, Machine
from escalator_twin.physics import run
from escalator_twin.signals import Experiment, Floats

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
ECCENTRICITY_M = 4e-4


def tread(cause: str, size: float, phase: float) -> Deviation:
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
        return partial(change_of, machine, experiment, base, frame, deviation, size)

    for name, (deviation, size) in {**ALL_PLACES, **WHOLE}.items():
        if name in ('load_distribution', 'load_offset') and not is_loaded:
            continue
        tasks[name] = cause_task(deviation, size)
    for k, phase in enumerate((0.5 * pi, 0.0)):
        tasks['eccentric', k] = cause_task(
            tread('roller_eccentricity', ECCENTRICITY_M, phase), ECCENTRICITY_M
        )
    found = run_all(tasks, jobs, progress)
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


def change_of(
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


def _shaken_columns(n_links: int) -> list[int]:
    """Return where all steps' accelerations along x and z are, as ``all_probes`` orders them."""
    first = 1 + 2 * n_links
    return [first + axis * n_links + k for axis in (0, 2) for k in range(n_links)]


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
