"""Forces of guide and drive on the axle ends."""

import numpy as np

from escalator_twin.physics.compiled import compiled, inlined
from escalator_twin.physics.parameters import Parameters
from escalator_twin.physics.path import (
    ARC,
    CARRIAGE,
    find_segment,
    KIND,
    RADIUS,
    SCALE,
    START,
    TURN,
)
from escalator_twin.physics.rails import rail_at, Rails
from escalator_twin.physics.state import NO_DOG, ROLLING, State, TIME, TRAVEL
from escalator_twin.signals import Floats

FLAT_HALF_WIDTH = np.deg2rad(10.0)  # contracts.md: a flat spot is about 20 deg wide
SATURATED = 19.1  # tanh is 1 in double precision from here on
# Rows of ``State.contact``. Of an end's place: whether its guide moves with the carriage, the tangent, the gap
# beside the channel's centre and its slope along the path, half the clearance, the path's curvature. Of its
# forces: of the contact across, what contact and drive add to its mass across and along, of all else along.
MOVES, TX, TZ, GAP, SLOPE, HALF, BEND, PUSH, ADDED, GRIPPED, ALONG = range(11)


@compiled
def ramp(s: float, start: float, end: float, length: float) -> float:
    """Return the share, 0 to 1, of a stretch with linear ramps inside its ends."""
    inside = min(s - start, end - s)
    if inside <= 0.0:
        return 0.0
    return 1.0 if inside >= length else inside / length


@compiled
def tread(turn: float, eccentricity: Floats, flat: Floats) -> float:
    """Return by how much a roller's radius exceeds the nominal one at its contact, m.

    Parameters
    ----------
    turn : float
        Angle rolled, rad.
    eccentricity, flat : (2,) float64
        Amplitude or depth in m, phase in rad.
    """
    excess = eccentricity[0] * np.sin(turn + eccentricity[1])
    angle = (turn + flat[1] + np.pi) % (2.0 * np.pi) - np.pi
    if abs(angle) < FLAT_HALF_WIDTH:
        excess -= flat[0] * 0.5 * (1.0 + np.cos(np.pi * angle / FLAT_HALF_WIDTH))
    return excess


@compiled
def hunting_time(time_s: float, lateness: Floats, step_s: float) -> float:
    """Return the time by the clock that hunting keeps, s.

    A run at even speed beside a machine whose speed wanders comes to a place sooner or later: the lateness,
    ``step_s`` apart from a time of 0 on and linear between, is by how much later the machine is there.
    """
    last = len(lateness) - 1
    where = min(max(time_s / step_s, 0.0), float(last))
    k = min(int(where), last)
    beyond = where - k
    return time_s + (1.0 - beyond) * lateness[k] + beyond * lateness[min(k + 1, last)]


@compiled
def rack_speed(
    speed: float, pitch_m: float, ripple: Floats, hunting: Floats, lateness: Floats,
    lateness_step_s: float, rack: Floats,
) -> float:  # fmt: skip
    """Return the rack's speed with its ripple, m/s; ``speed`` is its mean over time."""
    factor = 1.0
    if len(ripple):
        slow = 1.0
        for k in range(len(ripple)):
            turns = ripple[k, 1] * rack[TRAVEL] / pitch_m
            factor += ripple[k, 0] * np.sin(2.0 * np.pi * turns + ripple[k, 2])
            slow *= 1.0 - ripple[k, 0] ** 2
        # what ripples with travel is longer where it is slow: a metre would take 1 / sqrt(1 - a^2) of its time
        factor /= np.sqrt(slow)
    for k in range(len(hunting)):
        turns = hunting[k, 1] * hunting_time(rack[TIME], lateness, lateness_step_s)
        factor += hunting[k, 0] * np.sin(2.0 * np.pi * turns + hunting[k, 2])
    return speed * factor


@compiled
def saturating(x: float) -> float:
    """Return tanh(x), at once where it is 1."""
    if abs(x) > SATURATED:
        return 1.0 if x > 0.0 else -1.0
    return np.tanh(x)


@compiled
def stretch_drag(s: float, stretches: Floats) -> float:
    """Return the extra dry drag, N, of a roller at ``s`` in rows of (from, to, force)."""
    total = 0.0
    for k in range(len(stretches)):
        if stretches[k, 0] <= s <= stretches[k, 1]:
            total += stretches[k, 2]
    return total


@compiled
def curvature_of(segment: Floats, offset: float) -> float:
    """Return the path's curvature, 1/m, positive to the left, at a point ``offset`` beside it."""
    if segment[KIND] == ARC:
        return segment[TURN] / (segment[RADIUS] - segment[TURN] * offset)
    return 0.0


@inlined
def end_forces(
    p: Parameters, rails: Rails, state: State, q: Floats, v: Floats, w: Floats, h: float
) -> None:
    """Fill force and effective inverse mass of every axle end from guide and drive.

    The normal contact is a spring and damper beyond the clearance that never pulls. Its spring is
    taken at the mean of the gap, ``gap + h^2/4 gap''``: what the axle's and the moving parts'
    accelerations add to ``gap''`` goes into the system, what the path's curvature adds is known.
    """
    moving = len(state.reaction)
    lift, v_lift = (q[1], v[1]) if moving == 2 else (0.0, 0.0)
    gather(state, q, v, w, moving)
    project(p, rails, state, q[0], lift)
    for side in range(len(state.s)):
        press(
            state.rate, state.middle, state.contact, state.speed, state.normal, side,
            (p.contact_stiffness, p.contact_damping, h, v[0], v_lift),
        )  # fmt: skip
    resist(p, state)
    grip(p, state, h)
    assemble(p.end_mass, p.gravity, state.contact, state.force, state.inverse)
    react(state.contact, state.force, state.reaction, state.coupling, state.inertia)


@inlined
def gather(state: State, q: Floats, v: Floats, w: Floats, base: int) -> None:
    """Copy the axle ends' places and velocities out of MuJoCo's coordinates."""
    place, rate, middle = state.place, state.rate, state.middle
    _, m, n = place.shape
    stride = 1 + 2 * m
    for c in range(2):
        for side in range(m):
            first = base + 1 + 2 * side + c
            for i in range(n):
                j = first + i * stride
                place[c, side, i] = q[j]
                rate[c, side, i] = v[j]
                middle[c, side, i] = w[j]


@inlined
def project(p: Parameters, rails: Rails, state: State, u: float, lift: float) -> None:
    """Find every end's place on the guide, the carriage at ``u`` and the frame at ``lift``."""
    segments, hints, contact = p.segments, state.segment, state.contact
    eccentricity, flat, normal_rail = p.eccentricity, p.flat, rails.normal
    place, places, roll = state.place, state.s, state.roll
    per_m = normal_rail.shape[1] / p.length_m
    m, n = places.shape
    for side in range(m):
        for i in range(n):
            k, local, offset, tx, tz = find_segment(
                segments, hints[side, i], place[0, side, i], place[1, side, i], u, lift
            )
            hints[side, i] = k
            s = segments[k, START] + local * segments[k, SCALE]
            places[side, i] = s
            # beside the channel's centre as surveyed
            value, slope = rail_at(normal_rail, side, s * per_m, per_m)
            half = p.half_clearance
            if eccentricity[side, i, 0] != 0.0 or flat[side, i, 0] != 0.0:
                turn = roll[side, i] / p.roller_radius * (1.0 + p.tread_slip[side, i])
                half -= tread(turn, eccentricity[side, i], flat[side, i])
            contact[MOVES, side, i] = segments[k, CARRIAGE]
            contact[TX, side, i], contact[TZ, side, i] = tx, tz
            contact[GAP, side, i], contact[SLOPE, side, i] = offset - value, slope
            contact[HALF, side, i] = half
            contact[BEND, side, i] = curvature_of(segments[k], offset)


@compiled
def press(
    rate: Floats, middle: Floats, contact: Floats, speed: Floats, normal: Floats, side: int,
    law: tuple[float, float, float, float, float],
) -> None:  # fmt: skip
    """Fill the normal force of one side's ends, and their speed along the path.

    ``law`` holds stiffness and damping of a contact, the time step, and the speeds of carriage and
    frame. A tread too large for the channel meets both tracks.
    """
    k_n, c_n, h, v_u, v_lift = law
    spring_mass = 0.25 * h * h * k_n
    contact_mass = 0.5 * h * c_n + spring_mass
    vx_of, vz_of, wx_of, wz_of = rate[0, side], rate[1, side], middle[0, side], middle[1, side]
    moves, tx_of, tz_of = contact[MOVES, side], contact[TX, side], contact[TZ, side]
    gaps, slopes, halves = contact[GAP, side], contact[SLOPE, side], contact[HALF, side]
    bends, push, added = contact[BEND, side], contact[PUSH, side], contact[ADDED, side]
    speeds, normals = speed[side], normal[side]
    for i in range(len(speeds)):
        tx, tz, gap, half = tx_of[i], tz_of[i], gaps[i], halves[i]
        vx, vz = vx_of[i] + moves[i] * v_u, vz_of[i] - v_lift
        v_t, v_n = vx * tx + vz * tz, vz * tx - vx * tz
        speeds[i] = v_t
        beyond = abs(gap)
        is_tight = beyond < -half
        tracks = 2.0 if is_tight else 1.0
        edge = half if gap > 0.0 else -half
        spring = -2.0 * k_n * gap if is_tight else -k_n * (gap - edge)
        force = spring - tracks * c_n * (v_n - slopes[i] * v_t)
        is_on = (beyond > half) & (is_tight | (force * gap < 0.0))
        back = (wz_of[i] - vz_of[i]) * tx - (wx_of[i] - vx_of[i]) * tz
        pushed = force - tracks * (c_n * back - spring_mass * bends[i] * v_t * v_t)
        normals[i] = force if is_on else 0.0
        push[i] = pushed if is_on else 0.0
        added[i] = tracks * contact_mass if is_on else 0.0


@inlined
def resist(p: Parameters, state: State) -> None:
    """Fill the drag of every roller along the path."""
    guide_drag, rise, per_creep = p.guide_drag, p.friction_rise, 1.0 / p.creep_speed
    law_of, drag_of, viscous = p.rolling_resistance, p.roller_drag, p.viscous_drag
    m, n = state.s.shape
    extra = state.rack[ROLLING]
    for side in range(m):
        speeds, normals, along = state.speed[side], state.normal[side], state.contact[ALONG, side]
        for i in range(n):
            along[i] = law_of[side, i] * abs(normals[i])
        if rise != 0.0:
            for i in range(n):
                along[i] *= 1.0 + rise * np.exp(-abs(speeds[i] + extra) / p.friction_speed)
        if len(guide_drag):
            for i in range(n):
                along[i] += stretch_drag(state.s[side, i] % p.length_m, guide_drag)
        drags, slow = drag_of[side], 0
        for i in range(n):
            slow += abs((speeds[i] + extra) * per_creep) <= SATURATED
        if slow == 0:  # as always but while it starts: all at once
            for i in range(n):
                rolling = speeds[i] + extra
                drag = along[i] + drags[i]
                along[i] = -drag * np.copysign(1.0, rolling) - viscous * rolling
        else:
            for i in range(n):
                rolling = speeds[i] + extra
                drag = along[i] + drags[i]
                along[i] = -drag * saturating(rolling * per_creep) - viscous * rolling


@inlined
def grip(p: Parameters, state: State, h: float) -> None:
    """Add the drive to every end in its zone: by the dog nearest at entry, until it leaves."""
    start, end, ramp_m, spacing = p.drive_start, p.drive_end, p.drive_ramp, p.dog_spacing
    k_d, c_d, rack, dogs, contact = (
        p.drive_stiffness,
        p.drive_damping,
        state.rack,
        state.dog,
        state.contact,
    )
    rate, middle = state.rate, state.middle
    rack_v = rack_speed(p.speed, p.pitch_m, p.ripple, p.hunting, p.lateness, p.lateness_step, rack)
    drive_mass = 0.5 * h * c_d + 0.25 * h * h * k_d
    m, n = state.s.shape
    for side in range(m):
        for i in range(n):
            s = state.s[side, i]
            engaged = ramp(s, start, end, ramp_m)
            contact[GRIPPED, side, i] = engaged * drive_mass
            if engaged == 0.0:
                dogs[side, i] = NO_DOG
                continue
            if dogs[side, i] == NO_DOG:
                dogs[side, i] = int(np.floor((s - rack[TRAVEL]) / spacing + 0.5))
            ahead = rack[TRAVEL] + dogs[side, i] * spacing - s
            tx, tz = contact[TX, side, i], contact[TZ, side, i]
            back = (middle[0, side, i] - rate[0, side, i]) * tx
            back += (middle[1, side, i] - rate[1, side, i]) * tz
            late = rack_v - state.speed[side, i] - back
            contact[ALONG, side, i] += engaged * (k_d * ahead + c_d * late)


@compiled
def assemble(
    end_mass: Floats, gravity: float, contact: Floats, force: Floats, inverse: Floats
) -> None:
    """Fill force and effective inverse mass of every end."""
    for side in range(len(end_mass)):
        tx_of, tz_of, masses = contact[TX, side], contact[TZ, side], end_mass[side]
        push, added = contact[PUSH, side], contact[ADDED, side]
        gripped, along = contact[GRIPPED, side], contact[ALONG, side]
        fx, fz = force[0, side], force[1, side]
        xx, xz, zz = inverse[0, side], inverse[1, side], inverse[2, side]
        for i in range(len(masses)):
            tx, tz, mass = tx_of[i], tz_of[i], masses[i]
            fx[i] = along[i] * tx - push[i] * tz
            fz[i] = along[i] * tz + push[i] * tx - mass * gravity
            across, by = 1.0 / (mass + added[i]), 1.0 / (mass + gripped[i])
            xx[i] = across * tz * tz + by * tx * tx
            xz[i] = (by - across) * tx * tz
            zz[i] = across * tx * tx + by * tz * tz


@compiled
def react(
    contact: Floats, force: Floats, reaction: Floats, coupling: Floats, inertia: Floats
) -> None:
    """Fill what the same contacts do to the moving parts; the carriage's coordinate points to -x."""
    _, m, n = force.shape
    reaction[:] = 0.0
    inertia[:] = 0.0
    for side in range(m):
        moves, tx_of, tz_of = contact[MOVES, side], contact[TX, side], contact[TZ, side]
        added, fx = contact[ADDED, side], force[0, side]
        on_x, on_z = coupling[0, 0, side], coupling[0, 1, side]
        pushed, heavy = 0.0, 0.0
        for i in range(n):
            tx, tz = tx_of[i], tz_of[i]
            pull = added[i] * moves[i] * tz
            pushed += moves[i] * fx[i]
            heavy += pull * moves[i] * tz
            on_x[i], on_z[i] = -pull * tz, pull * tx
        reaction[0] += pushed
        inertia[0, 0] += heavy
        if len(reaction) == 2:
            push, along = contact[PUSH, side], contact[ALONG, side]
            lift_x, lift_z = coupling[1, 0, side], coupling[1, 1, side]
            lifted, shared, heavy = 0.0, 0.0, 0.0
            for i in range(n):
                tx, tz = tx_of[i], tz_of[i]
                lifted -= along[i] * tz + push[i] * tx
                shared += added[i] * moves[i] * tz * tx
                heavy += added[i] * tx * tx
                lift_x[i], lift_z[i] = -added[i] * tx * tz, added[i] * tx * tx
            reaction[1] += lifted
            inertia[0, 1] += shared
            inertia[1, 1] += heavy
