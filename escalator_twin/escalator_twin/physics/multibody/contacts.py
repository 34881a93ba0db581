"""Contacts of points with segments: search of all pairs, force of one, what it adds to inertia.

Functions for one pair take arrays and numbers: a NamedTuple handed on costs more than they do.
"""

import numpy as np

from escalator_twin.physics.compiled import compiled
from escalator_twin.physics.contact import ramp
from escalator_twin.physics.multibody import network as net
from escalator_twin.physics.multibody import segments as seg
from escalator_twin.physics.multibody.law import friction_law, normal_law, resistance_law
from escalator_twin.physics.multibody.network import Integers, Memory, Network
from escalator_twin.signals import Floats

SEARCH_STEPS = 25  # between two searches of all pairs
REACH_M = 0.03  # a point nearer to a segment counts as near: at 1e-4 s, good for 12 m/s
TAIL_M = 0.05  # of a moving arc, while searching

Touch = tuple[
    bool, float, float, float, float, float, float, float, float, float, float, float, float
]


@compiled
def search(
    q: Floats, segments: Floats, part: Floats, base: int,
    points: tuple[Integers, Floats, Integers], near: Integers,
) -> None:  # fmt: skip
    """Go through all pairs and note for every point the segments it is near.

    ``points`` holds body, offset and first and last segment of every point.
    """
    body, offset, rows = points
    for c in range(len(body)):
        b = 3 * body[c]
        x, z = q[b], q[b + 1]
        if offset[c] != 0.0:
            x += offset[c] * np.cos(q[b + 2])
            z += offset[c] * np.sin(q[b + 2])
        found = 0
        for k in range(rows[c, 0], rows[c, 1]):
            dx, dz = x, z
            if segments[k, seg.PART] >= 0.0:
                p = int(segments[k, seg.PART])
                dx -= q[base + p] * part[p, net.P_X]
                dz -= q[base + p] * part[p, net.P_Z]
            if found < net.MOST_NEAR and is_near(segments, k, dx, dz):
                near[c, found] = k
                found += 1
        for j in range(found, net.MOST_NEAR):
            near[c, j] = -1


@compiled
def is_near(segments: Floats, k: int, x: float, z: float) -> bool:
    """Tell whether a point is beside a segment, or within reach of being so."""
    width = segments[k, seg.WIDTH]
    reach = REACH_M + (width if width < 1.0 else 0.0)
    dx, dz = x - segments[k, seg.X], z - segments[k, seg.Z]
    ux, uz = segments[k, seg.UX], segments[k, seg.UZ]
    along, across = dx * ux + dz * uz, dz * ux - dx * uz
    if segments[k, seg.TURN] == 0.0:
        return -REACH_M <= along <= segments[k, seg.LENGTH] + REACH_M and abs(across) <= reach
    radius = segments[k, seg.RADIUS]
    squared = dx * dx + dz * dz
    if squared > (radius + reach) ** 2 or (radius > reach and squared < (radius - reach) ** 2):
        return False
    beyond = (REACH_M + TAIL_M * segments[k, seg.TAIL]) / radius
    return abs(np.arctan2(across, along)) <= segments[k, seg.HALF] + beyond


@compiled
def touch(
    segments: Floats, k: int, x: float, z: float, v: tuple[float, float, float],
    arm: tuple[float, float], surface: float, tail: float, h: float, lifted: float,
) -> Touch:  # fmt: skip
    """Return what one pair does: a point on segment ``k``.

    Parameters
    ----------
    segments : (g, 26) float64
    k : int
    x, z : float
        The point, seen from what carries the segment.
    v : tuple of float
        Its velocity, seen from there, and its body's spin.
    arm : tuple of float
        From the body's centre to it.
    surface : float
        Speed of the segment's surface along the path.
    tail : float
        By how much an arc goes on straight.
    h : float
        Time step.
    lifted : float
        By how much the segment stands out here.

    Returns
    -------
    beside : bool
    s, tx, tz, speed : float
        Way along the segment, tangent, speed along it.
    normal : float
        Force, positive on a lower face.
    drag : float
        Friction against the speed, at the touching surface.
    moment : float
        Of all about the body's centre.
    across, along : float
        What the contact adds to inertia across and along the path: h D + h^2/4 K, so that the
        step is linearly implicit in it: second order for what is elastic, monotone for what damps.
    arm_across, arm_along : float
        Arms of these forces about the body's centre.
    depth : float
    """
    beside, s, e, tx, tz = seg.locate(segments[k], x, z, tail)
    if not beside:
        return False, s, tx, tz, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    vx, vz, spin = v
    ox, oz = arm
    e -= lifted
    nx, nz = -tz, tx
    speed = vx * tx + vz * tz
    low = segments[k, seg.LOW]
    low += (segments[k, seg.LOW_END] - low) * s / segments[k, seg.LENGTH]
    side, depth, stiffness = 1.0, low - e, segments[k, seg.STIFF_LOW]
    if depth <= 0.0:
        side, depth = -1.0, e - low - segments[k, seg.WIDTH]
        stiffness = segments[k, seg.STIFF_HIGH]
        if depth <= 0.0:
            return True, s, tx, tz, speed, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, depth
    force, slope, damping = normal_law(
        depth, -side * (vx * nx + vz * nz), stiffness, segments[k, seg.LOSS],
        segments[k, seg.NORMAL_SPEED],
    )  # fmt: skip
    lever = -side * segments[k, seg.LEVER]
    # of forces along n and t at the touching surface, about the body's centre
    arm_n = ox * nz - oz * nx
    arm_t = ox * tz - oz * tx - lever
    drag, drag_slope = friction_law(
        speed - spin * lever - surface, force, segments[k, seg.FRICTION],
        segments[k, seg.SLIDING_SPEED],
    )  # fmt: skip
    moment = side * force * arm_n - drag * arm_t
    added = h * damping + 0.25 * h * h * slope
    return (
        True, s, tx, tz, speed, side * force, drag, moment, added, h * drag_slope, arm_n, arm_t,
        depth,
    )  # fmt: skip


@compiled
def flank(
    segments: Floats, k: int, s: float, sliding: float, angle: float, shift: float, h: float
) -> tuple[float, float]:
    """Return the push of a gear's seat along the path, and what it adds to inertia.

    ``s`` is the way along the arc, ``sliding`` the speed against the gear, ``angle`` the gear's;
    ``shift`` moves the seats along the path. Flanks engage along a ramp inside both ends.
    """
    arc = segments[k, seg.SEAT_ARC]
    off = s - angle * segments[k, seg.RADIUS] - shift
    off -= arc * np.floor(off / arc + 0.5)
    depth = abs(off) - segments[k, seg.SEAT_PLAY]
    if depth <= 0.0:
        return 0.0, 0.0
    side = 1.0 if off > 0.0 else -1.0
    share = ramp(s, 0.0, segments[k, seg.LENGTH], segments[k, seg.SEAT_RAMP])
    force, slope, damping = normal_law(
        depth, side * sliding, share * segments[k, seg.SEAT_STIFF], segments[k, seg.LOSS],
        segments[k, seg.NORMAL_SPEED],
    )  # fmt: skip
    return -side * force, h * damping + 0.25 * h * h * slope


@compiled
def run_out(
    segments: Floats, k: int, x: float, z: float, rotor: Floats, r: int, turned: float
) -> tuple[float, float, float, float, float, float]:
    """Return what an eccentric gear does at a point.

    Rail and rim hand a roller over along the ramp along which flanks engage: there the rim does
    not stand out yet.

    Returns
    -------
    lifted, shift : float
        By how much the rim stands out and the seats are moved along, m.
    per_turn : float
        What ``lifted`` gains by a radian of the gear, its place on the path held, m.
    slope : float
        What it gains by a metre along the path, the gear held.
    ox, oz : float
        Outwards.
    """
    dx, dz = x - segments[k, seg.X], z - segments[k, seg.Z]
    ux, uz, turn = segments[k, seg.UX], segments[k, seg.UZ], segments[k, seg.TURN]
    angle = turn * np.arctan2(dz * ux - dx * uz, dx * ux + dz * uz) + segments[k, seg.HALF]
    radius, length, reach = (
        segments[k, seg.RADIUS],
        segments[k, seg.LENGTH],
        segments[k, seg.SEAT_RAMP],
    )
    way = angle * radius
    share, steep = ramp(way, 0.0, length, reach), 0.0
    if 0.0 < share < 1.0:
        steep = 1.0 / reach if way < 0.5 * length else -1.0 / reach
    angle += rotor[r, net.R_PHASE] - turned
    size = rotor[r, net.R_ECCENTRIC]
    out, along, distance = size * np.cos(angle), size * np.sin(angle), np.sqrt(dx * dx + dz * dz)
    slope = steep * out - share * along / radius
    return share * out, -along, share * along, slope, dx / distance, dz / distance


@compiled
def add(added: Floats, i: int, size: float, gx: float, gz: float, ga: float) -> None:
    """Add ``size`` times the dyad of (gx, gz, ga) to what contacts add to a body's mass."""
    added[i, 0] += size * gx * gx
    added[i, 1] += size * gx * gz
    added[i, 2] += size * gx * ga
    added[i, 3] += size * gz * gz
    added[i, 4] += size * gz * ga
    added[i, 5] += size * ga * ga


@compiled
def resist(
    force: Floats, added: Floats, drags: Floats, c: int, i: int, rolling: float, load: float,
    h: float,
) -> None:  # fmt: skip
    """Add the drag of a roller's tread and bearing to its spin.

    What its axle would feel of the bearing's part, a tenth of a newton metre, is left out.
    """
    radius = drags[c, net.D_RADIUS]
    law = (drags[c, net.D_RESIST], drags[c, net.D_RISE], drags[c, net.D_FADE],
           drags[c, net.D_SEAL], drags[c, net.D_VISCOUS], drags[c, net.D_CREEP])  # fmt: skip
    drag, slope = resistance_law(rolling * radius, load, law)
    force[i, 2] -= radius * drag
    added[i, 5] += h * slope * radius * radius


@compiled
def contacts(n: Network, m: Memory, q: Floats, w: Floats, h: float) -> None:
    """Add the forces of all pairs that are near."""
    segments, part, rotor, base = n.segments, n.part, n.rotor, 3 * len(n.mass)
    body, offsets, near, partner = n.point_body, n.point_offset, m.near, n.point_partner
    force, added, normal, drags = m.force, m.added, m.normal, n.drag
    touching, way, speeds, turning = m.touching, m.s, m.speed, m.rotor
    part_force, part_added, torque = m.part_force, m.part_added, m.torque
    for c in range(len(body)):
        normal[c], touching[c] = 0.0, -1
        i = body[c]
        b = 3 * i
        ox = oz = 0.0
        if offsets[c] != 0.0:
            ox, oz = offsets[c] * np.cos(q[b + 2]), offsets[c] * np.sin(q[b + 2])
        spin = w[b + 2]
        for j in range(net.MOST_NEAR):
            k = near[c, j]
            if k < 0:
                break
            x, z = q[b] + ox, q[b + 1] + oz
            vx, vz = w[b] - spin * oz, w[b + 1] + spin * ox
            p, r = int(segments[k, seg.PART]), int(segments[k, seg.ROTOR])
            tail = surface = lifted = shift = per_turn = slope = 0.0
            if p >= 0:
                moved, rate = q[base + p], w[base + p]
                x, z = x - moved * part[p, net.P_X], z - moved * part[p, net.P_Z]
                vx, vz = vx - rate * part[p, net.P_X], vz - rate * part[p, net.P_Z]
                tail = segments[k, seg.TAIL] * max(moved, 0.0)
            if r >= 0:
                surface = turning[r, 1] * rotor[r, net.R_RADIUS]
                if rotor[r, net.R_ECCENTRIC] != 0.0:
                    lifted, shift, per_turn, slope, out_x, out_z = run_out(
                        segments, k, x, z, rotor, r, turning[r, 0]
                    )
                    rise = per_turn * turning[r, 1]
                    vx, vz = vx - rise * out_x, vz - rise * out_z
            v, arm = (vx, vz, spin), (ox, oz)
            beside, s, tx, tz, speed, push, drag, moment, across, along, arm_n, arm_t, depth = (
                touch(segments, k, x, z, v, arm, surface, tail, h, lifted)
            )
            if not beside:
                continue
            touching[c], way[c], speeds[c] = k, segments[k, seg.START] + s, speed
            fx, fz = -push * tz - drag * tx, push * tx - drag * tz
            if depth > 0.0:
                normal[c] += push
                add(added, i, across, -tz, tx, arm_n)
                add(added, i, along, tx, tz, arm_t)
            if r >= 0:
                # the rim's slope pushes back what climbs it; as the gear turns, it lifts
                fx, fz = fx - push * slope * tx, fz - push * slope * tz
                torque[r] += push * per_turn - drag * rotor[r, net.R_RADIUS]
                if segments[k, seg.SEAT_ARC] > 0.0:
                    drive, more = flank(segments, k, s, speed - surface, turning[r, 0], shift, h)
                    fx, fz = fx + drive * tx, fz + drive * tz
                    torque[r] += drive * rotor[r, net.R_RADIUS]
                    add(added, i, more, tx, tz, 0.0)
            force[i, 0] += fx
            force[i, 1] += fz
            force[i, 2] += moment
            if p >= 0:
                part_force[p] -= fx * part[p, net.P_X] + fz * part[p, net.P_Z]
                lean = tx * part[p, net.P_Z] - tz * part[p, net.P_X]
                part_added[p] += across * lean * lean
        if drags[c, net.D_RADIUS] > 0.0:
            carrier = partner[c]
            rolling = spin - (w[3 * carrier + 2] if carrier >= 0 else 0.0)
            resist(force, added, drags, c, i, rolling, abs(normal[c]), h)
