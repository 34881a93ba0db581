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
from escalator_twin.physics.state import NO_DOG, ROLLING, State, TIME, TRAVEL
from escalator_twin.signals import Floats

FLAT_HALF_WIDTH = np.deg2rad(10.0)  # contracts.md: a flat spot is about 20 deg wide
SATURATED = 19.1  # tanh is 1 in double precision from here on


@compiled
def table_at(tables: Floats, row: int, position: float, per_m: float) -> tuple[float, float]:
    """Return value and slope of a periodic table by cubic Hermite.

    Parameters
    ----------
    tables : (m, n, 2) float64
        Values and slopes (per m) on even grids.
    row : int
        Of the tables.
    position : float
        In steps of the grid.
    per_m : float
        Grid steps per metre.
    """
    n = tables.shape[1]
    low = int(np.floor(position))
    t = position - low
    i = low if 0 <= low < n else low % n
    j = i + 1 if i + 1 < n else 0
    v0, v1 = tables[row, i, 0], tables[row, j, 0]
    g0, g1 = tables[row, i, 1], tables[row, j, 1]
    rest = 1.0 - t
    value = v0 * (1.0 + 2.0 * t) * rest * rest + v1 * t * t * (3.0 - 2.0 * t)
    value += t * rest * (g0 * rest - g1 * t) * (1.0 / per_m)
    slope = 6.0 * t * rest * (v1 - v0) * per_m
    slope += g0 * rest * (1.0 - 3.0 * t) + g1 * t * (3.0 * t - 2.0)
    return value, slope


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
def rack_speed(
    speed: float, pitch_m: float, ripple: Floats, hunting: Floats, rack: Floats
) -> float:
    """Return the rack's speed with its ripple, m/s."""
    factor = 1.0
    for k in range(len(ripple)):
        turns = ripple[k, 1] * rack[TRAVEL] / pitch_m
        factor += ripple[k, 0] * np.sin(2.0 * np.pi * turns + ripple[k, 2])
    for k in range(len(hunting)):
        turns = hunting[k, 1] * rack[TIME]
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
def end_forces(p: Parameters, state: State, q: Floats, v: Floats, w: Floats, h: float) -> None:
    """Fill force and effective inverse mass of every axle end from guide and drive.

    The normal contact is a spring and damper beyond the clearance that never pulls. Its spring is
    taken at the mean of the gap, ``gap + h^2/4 gap''``: what the axle's and the moving parts'
    accelerations add to ``gap''`` goes into the system, what the path's curvature adds is known.
    """
    segments, survey, length_m, gravity = p.segments, p.survey, p.length_m, p.gravity
    end_mass, law_of, drag_of = p.end_mass, p.rolling_resistance, p.roller_drag
    eccentricity, flat, guide_drag = p.eccentricity, p.flat, p.guide_drag
    tread_slip = p.tread_slip
    hints, dogs, places, speeds = state.segment, state.dog, state.s, state.speed
    normals, force, inverse, rack = state.normal, state.force, state.inverse, state.rack
    reaction, coupling, inertia = state.reaction, state.coupling, state.inertia
    roll = state.roll
    k_n, c_n, k_d, c_d = p.contact_stiffness, p.contact_damping, p.drive_stiffness, p.drive_damping
    creep, viscous, rise, rise_speed = (
        p.creep_speed,
        p.viscous_drag,
        p.friction_rise,
        p.friction_speed,
    )
    start, end, ramp_m, spacing = p.drive_start, p.drive_end, p.drive_ramp, p.dog_spacing
    m, n = places.shape
    moving = len(reaction)
    lift, v_lift = (q[1], v[1]) if moving == 2 else (0.0, 0.0)
    u, v_u = q[0], v[0]
    stride = 1 + 2 * m
    rack_v = rack_speed(p.speed, p.pitch_m, p.ripple, p.hunting, rack)
    per_m = survey.shape[1] / length_m
    spring_mass = 0.25 * h * h * k_n
    contact_mass = 0.5 * h * c_n + spring_mass
    drive_mass = 0.5 * h * c_d + 0.25 * h * h * k_d
    half_clearance, radius = p.half_clearance, p.roller_radius
    reaction[:] = 0.0
    inertia[:] = 0.0
    for side in range(m):
        for i in range(n):
            j = moving + i * stride + 1 + 2 * side
            x, z = q[j], q[j + 1]
            k, local, offset, tx, tz = find_segment(segments, hints[side, i], x, z, u, lift)
            hints[side, i] = k
            moves = segments[k, CARRIAGE]
            s = segments[k, START] + local * segments[k, SCALE]
            places[side, i] = s
            vx, vz = v[j] + moves * v_u, v[j + 1] - v_lift
            v_t, v_n = vx * tx + vz * tz, vz * tx - vx * tz
            back_x, back_z = w[j] - v[j], w[j + 1] - v[j + 1]
            speeds[side, i] = v_t
            # gap beside the channel's centre as surveyed
            value, slope = table_at(survey, side, s * per_m, per_m)
            gap = offset - value
            rate = v_n - slope * v_t
            half = half_clearance
            if eccentricity[side, i, 0] != 0.0 or flat[side, i, 0] != 0.0:
                turn = roll[side, i] / radius * (1.0 + tread_slip[side, i])
                half -= tread(turn, eccentricity[side, i], flat[side, i])
            normal, push, added, tracks = 0.0, 0.0, 0.0, 1.0
            if abs(gap) > half:
                spring = -k_n * (gap - half if gap > 0.0 else gap + half)
                if abs(gap) < -half:  # a tread too large for the channel meets both tracks
                    spring, tracks = -2.0 * k_n * gap, 2.0
                normal = spring - tracks * c_n * rate
                if normal * gap < 0.0 or tracks == 2.0:
                    push = normal - tracks * c_n * (back_z * tx - back_x * tz)
                    bend = curvature_of(segments[k], offset)
                    push += tracks * spring_mass * bend * v_t * v_t
                    added = tracks * contact_mass
                else:
                    normal = 0.0
            normals[side, i] = normal
            # drag along the path
            rolling = v_t + rack[ROLLING]
            drag = law_of[side, i] * abs(normal)
            if rise != 0.0:
                drag *= 1.0 + rise * np.exp(-abs(rolling) / rise_speed)
            drag += drag_of[side, i]
            if len(guide_drag):
                drag += stretch_drag(s % length_m, guide_drag)
            along = -drag * saturating(rolling / creep) - viscous * rolling
            # drive: the dog nearest at entry, held until the axle leaves
            engaged = ramp(s, start, end, ramp_m)
            if engaged > 0.0:
                if dogs[side, i] == NO_DOG:
                    dogs[side, i] = int(np.floor((s - rack[TRAVEL]) / spacing + 0.5))
                ahead = rack[TRAVEL] + dogs[side, i] * spacing - s
                late = rack_v - v_t - back_x * tx - back_z * tz
                along += engaged * (k_d * ahead + c_d * late)
            else:
                dogs[side, i] = NO_DOG
            fx, fz = along * tx - push * tz, along * tz + push * tx
            mass = end_mass[side, i]
            force[side, i, 0] = fx
            force[side, i, 1] = fz - mass * gravity
            b_n, b_t = 1.0 / (mass + added), 1.0 / (mass + engaged * drive_mass)
            inverse[side, i, 0] = b_n * tz * tz + b_t * tx * tx
            inverse[side, i, 1] = (b_t - b_n) * tx * tz
            inverse[side, i, 2] = b_n * tx * tx + b_t * tz * tz
            # the same contact seen from the carriage, whose coordinate points to -x
            reaction[0] += moves * fx
            pull = added * moves * tz
            coupling[side, i, 0, 0] = -pull * tz
            coupling[side, i, 0, 1] = pull * tx
            inertia[0, 0] += pull * moves * tz
            if moving == 2:
                reaction[1] -= fz
                inertia[0, 1] += pull * tx
                inertia[1, 1] += added * tx * tx
                coupling[side, i, 1, 0] = -added * tx * tz
                coupling[side, i, 1, 1] = added * tx * tx
