"""A network of free planar bodies as the compiled law reads it: all numbers, and its memory.

Coordinates: q = [x, z, angle of body 0, of body 1, ..., parts, rotors]. An angle turns x towards z.
Parts are supports that slide along one line on a spring; rotors turn as they are told. Several
networks that do not touch join into one.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from escalator_twin.physics.multibody.segments import N_COLUMNS, PART, ROTOR
from escalator_twin.signals import Floats

Integers = NDArray[np.int64]
MOST_NEAR = 4  # segments that one point can be near
# columns of ``part``
P_MASS, P_STIFF, P_DAMP, P_PUSH, P_FRICTION, P_X, P_Z, P_STOP, P_STOP_STIFF, P_STOP_DAMP = range(
    10
)
# columns of ``rotor``: target speed (rad/s), radius of what it drives (m), eccentricity: amplitude
# (m), phase (rad), turns of what carries it per rad of the rotor
R_SPEED, R_RADIUS, R_RAMP, R_ECCENTRIC, R_PHASE = range(5)
# columns of ``link``: stiffness, damping, free length, bending stiffness (N m/rad), bending
# drag (N m), rate at which that saturates (rad/s)
L_STIFF, L_DAMP, L_FREE, L_BEND, L_BEND_DRAG, L_BEND_RATE = range(6)
# columns of ``drag``: see `law.resistance_law`; radius; dry drag on the body itself
D_RESIST, D_RISE, D_FADE, D_SEAL, D_VISCOUS, D_CREEP, D_RADIUS, D_DRY = range(8)


class Network(NamedTuple):
    """Numbers; b bodies, l links, j bushes, c contact points, g segments, p parts, r rotors."""

    mass: Floats  # (b,)
    inertia: Floats  # (b,)
    link_ends: Integers  # (l, 2) bodies
    link: Floats  # (l, 6)
    bush_ends: Integers  # (j, 2): body that turns freely about the bush, body that carries it
    bush: Floats  # (j, 4): place on the carrying body x, z; stiffness, damping
    point_body: Integers  # (c,)
    point_offset: Floats  # (c,) of the point on its body, along its axis
    point_rows: Integers  # (c, 2) first and one past the last segment that it can touch
    point_partner: Integers  # (c,) body about whose bearing it turns, -1 for none
    drag: Floats  # (c, 8) of a roller
    segments: Floats  # (g, 26)
    part: Floats  # (p, 10)
    rotor: Floats  # (r, 5)
    load: Floats  # (b,) weight on a body while its point is on the loaded stretch, N
    load_point: Integers  # (b,) whose path coordinate tells that; -1 without
    load_stretch: Floats  # (3,): from, to, ramp, m
    stretch_drag: Floats  # (k, 5): first and past the last segment, from, to (m), N per body
    gravity: float


class Memory(NamedTuple):
    """What the law remembers and finds."""

    acceleration: Floats  # (nv,)
    force: Floats  # (b, 3)
    added: Floats  # (b, 6): what contacts add to mass: xx, xz, xa, zz, za, aa
    near: Integers  # (c, MOST_NEAR) segments, -1 for none
    touching: Integers  # (c,) segment, -1 for none
    s: Floats  # (c,) path coordinate
    normal: Floats  # (c,) N, positive on a lower face
    speed: Floats  # (c,) along the path, m/s
    tension: Floats  # (l,) N
    torque: Floats  # (r,) at a rotor's shaft, N m, positive where it drives
    rotor: Floats  # (r, 2): angle, speed
    part_force: Floats  # (p,)
    part_added: Floats  # (p,)
    clock: Floats  # (3,): time s, steps since the last search, share of the target speed


def empty_segments() -> Floats:
    """Return no segments."""
    return np.zeros((0, N_COLUMNS))


def make_memory(n: Network) -> Memory:
    """Return an empty memory for a network."""
    bodies, points = len(n.mass), len(n.point_body)
    nv = 3 * bodies + len(n.part) + len(n.rotor)
    return Memory(
        acceleration=np.zeros(nv),
        force=np.zeros((bodies, 3)),
        added=np.zeros((bodies, 6)),
        near=np.full((points, MOST_NEAR), -1, np.int64),
        touching=np.full(points, -1, np.int64),
        s=np.zeros(points),
        normal=np.zeros(points),
        speed=np.zeros(points),
        tension=np.zeros(len(n.link)),
        torque=np.zeros(len(n.rotor)),
        rotor=np.zeros((len(n.rotor), 2)),
        part_force=np.zeros(len(n.part)),
        part_added=np.zeros(len(n.part)),
        clock=np.zeros(3),
    )


def join(first: Network, second: Network) -> Network:
    """Return two networks that do not touch as one; loads and gravity are the first's."""
    bodies, points, rows = len(first.mass), len(first.point_body), len(first.segments)
    parts, rotors = len(first.part), len(first.rotor)
    moved = second.segments.copy()
    for column, shift in ((PART, parts), (ROTOR, rotors)):
        moved[moved[:, column] >= 0.0, column] += shift

    def shifted(index: Integers, by: int) -> Integers:
        return np.where(index >= 0, index + by, index)

    both: dict[str, Any] = {
        name: np.concatenate([getattr(first, name), getattr(second, name)])
        for name in ('mass', 'inertia', 'link', 'bush', 'point_offset', 'drag', 'part', 'rotor',
                     'load')
    }  # fmt: skip
    stretches = second.stretch_drag.copy()
    stretches[:, :2] += rows
    changed = dict(
        both,
        link_ends=np.concatenate([first.link_ends, shifted(second.link_ends, bodies)]),
        bush_ends=np.concatenate([first.bush_ends, shifted(second.bush_ends, bodies)]),
        point_body=np.concatenate([first.point_body, shifted(second.point_body, bodies)]),
        point_rows=np.concatenate([first.point_rows, second.point_rows + rows]),
        point_partner=np.concatenate([first.point_partner, shifted(second.point_partner, bodies)]),
        load_point=np.concatenate([first.load_point, shifted(second.load_point, points)]),
        segments=np.concatenate([first.segments, moved]),
        stretch_drag=np.concatenate([first.stretch_drag, stretches]),
    )
    return changed_in(first, **changed)


def changed_in(network: Network, **changes: Any) -> Network:
    """Return a network with some of its arrays replaced."""
    return Network(**{**network._asdict(), **changes})
