"""Where a run starts from: the machine at rest, its rack held, at any place of the loop."""

import numpy as np

from escalator_twin.errors import ExperimentError
from escalator_twin.physics import run
from escalator_twin.physics.parameters import Parameters
from escalator_twin.physics.path import GuidePath, point_at, START
from escalator_twin.physics.polygon import inscribe
from escalator_twin.physics.rails import Rails
from escalator_twin.physics.state import NO_DOG, ROLLING, State
from escalator_twin.signals import Floats

RELAX_S = 8.0
RELAX_STEPS_S = (2e-3, 5e-4, 1.25e-4)  # the next is tried where one fails: very stiff links
RELAX_RATE = 12.0  # 1/s, about critical for the carriage on its spring with half the chain
AT_REST = 1e-3  # m/s, largest speed that passes for rest
STILL = 1e-7  # m/s, of a rest to be kept
# The same where the machine runs for seconds before anything is recorded: the carriage is then some 5 um off,
# of which a hundredth is left, in half the steps.
NEARLY_STILL = 1e-4


def find_rest(
    p: Parameters,
    rails: Rails,
    state: State,
    path: GuidePath,
    place_m: float,
    rolled_m: float,
    still: float = STILL,
) -> Floats:
    """Return the coordinates at rest with axle 0 about at a place and the rack held there.

    Parameters
    ----------
    p, rails, state : Parameters, Rails, State
        Of the force law; the state becomes that of the rest.
    path : GuidePath
        The guide.
    place_m : float
        Path coordinate of axle 0, m.
    rolled_m : float
        The way that every roller has rolled, m, 0 being at the first sample.
    still : float
        Speed below which nothing moves, m/s.

    Raises
    ------
    ExperimentError
        Where no equilibrium is found.
    """
    # the rack stands; dry friction on the carriage would let it creep to its place
    free = p._replace(speed=0.0, carriage_friction=0.0)
    worst = np.inf
    for step_s in RELAX_STEPS_S:
        q = _polygon_pose(p, state, path, place_m)
        state.roll[:] = rolled_m
        w = np.zeros_like(q)
        worst = run.relax(
            free, rails, state, q, w, step_s, round(RELAX_S / step_s), RELAX_RATE, still
        )
        if np.isfinite(q).all() and worst < AT_REST:
            state.rack[ROLLING] = 0.0
            return q
    raise ExperimentError(
        f'no static equilibrium with axle 0 at {place_m:.3f} m: '
        f'the largest speed after {RELAX_S} s is {worst:.2g} m/s'
    )


def _polygon_pose(p: Parameters, state: State, path: GuidePath, place_m: float) -> Floats:
    """Put all axles on the rigid polygon, and the rack where it has the axle in the drive."""
    corners, u = inscribe(path, p.link_length.mean(axis=0), place_m)
    base, stride = len(state.reaction), 1 + 2 * p.n_sides
    q = np.zeros(len(state.acceleration))
    q[0] = u
    starts = p.segments[:, START]
    for i, s in enumerate(corners):
        x, z, _, _ = point_at(p.segments, p.length_m, s, u)
        state.segment[:, i] = int(np.searchsorted(starts, s % p.length_m, side='right')) - 1
        for side in range(p.n_sides):
            j = base + i * stride + 1 + 2 * side
            q[j], q[j + 1] = x, z
    state.dog[:] = NO_DOG
    state.acceleration[:] = 0.0
    middle = 0.5 * (p.drive_start + p.drive_end)
    nearest = corners[int(np.argmin(np.abs(corners % p.length_m - middle)))] % p.length_m
    state.rack[:] = nearest % p.dog_spacing, 0.0, p.speed
    return q


def set_off(p: Parameters, state: State, velocity: Floats, speed: float) -> None:
    """Give every axle end a speed along the path, and all else none."""
    base, stride = len(state.reaction), 1 + 2 * p.n_sides
    velocity[:] = 0.0
    state.acceleration[:] = 0.0
    for side in range(p.n_sides):
        for i in range(state.s.shape[1]):
            _, _, tx, tz = point_at(p.segments, p.length_m, state.s[side, i], 0.0)
            j = base + i * stride + 1 + 2 * side
            velocity[j], velocity[j + 1] = speed * tx, speed * tz
