"""What effects do whose small change says little about a large one."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from math import ceil, pi

import numpy as np

from escalator_twin.diagnosis.grids import Loop
from escalator_twin.diagnosis.loops import all_probes, simulate_loop
from escalator_twin.diagnosis.responses import change_of, Responses, tread
from escalator_twin.diagnosis.simultaneous import run_all
from escalator_twin.diagnosis.tolerances import Columns
from escalator_twin.machine import Deviation, Machine
from escalator_twin.signals import Experiment, Floats

STOP_SHARES = (0.2, 0.5, 0.8)  # of the carriage's motion above its mean
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
FLAT_M = 6e-4
# Along the tread between the phases at which a flat spot is run. What it does changes slowly along the guide: told from
# 23 of 46 phases it was off by 7 % in amplitude at 0.26 m/s, from 12 of 24 at 0.5 m/s by 10 %.
SPOT_M = 0.0105


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
        tasks[key] = partial(change_of, machine, experiment, base, frame, deviation)
    for level in stops:
        deviation = Deviation('tensioner_stop', {'displacement_m': level})
        tasks[level] = partial(change_of, machine, experiment, base, frame, deviation)
    found = run_all(tasks, jobs, None)
    return replace(
        responses,
        far={key: found[key].columns for key in FAR},
        stops={level: found[level].columns for level in stops},
    )


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
            change_of, machine, experiment, base, frame,
            tread('roller_flat', FLAT_M, 2.0 * pi * k / count), FLAT_M,
        )
        for k in range(count)
    }  # fmt: skip
    found = run_all(tasks, jobs, None)
    rolled = found[0].rolled_m
    assert rolled is not None, 'a machine with a flat spot is not the same after a pitch'
    return np.stack([found[k].columns for k in range(count)]), rolled


def _stop_levels(base: Loop) -> list[float]:
    """Return displacements of the carriage in the upper half of its motion, m."""
    motion = base.columns[:, 0]
    middle = 0.5 * float(motion.max() + motion.min())
    return [middle + share * (float(motion.max()) - middle) for share in STOP_SHARES]
