"""The force law and its linearly implicit step, compiled.

MuJoCo holds the state and integrates with its semi-implicit Euler method, whose velocity then
stands at the middle of the step (leapfrog). For stiff links the force handed over is that of the
average-acceleration form,

    (M + h/2 D + h^2/4 K) a = f(q_n, w),    w = qvel at n - 1/2,

which is of second order, takes no energy, and leaves the step size to accuracy. K and D hold
links, contacts and drive; what is soft against an axle's inertia stays explicit: racking, and the
carriage's share of a contact. Links couple neighbours by one direction each, so the system
reduces to one cyclic tridiagonal one in the link forces, of cost proportional to their number.

Coordinates: q = [carriage, (frame), axle 0: y, (x, z) of each side, axle 1: ...].
"""

from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from escalator_twin.physics.path import CARRIAGE, find_segment, SCALE, START
from escalator_twin.signals import Floats

NO_DOG = -(2**40)
FLAT_HALF_WIDTH = np.deg2rad(10.0)  # contracts.md: a flat spot is about 20 deg wide


class State(NamedTuple):
    """What the law remembers and shows beside MuJoCo's coordinates; m sides, n axles."""

    rack: Floats  # (3,): travel of the rack m, time s, rolling speed while relaxing m/s
    segment: NDArray[np.int64]  # (m, n)
    dog: NDArray[np.int64]  # (m, n)
    roll: Floats  # (m, n) rolled way, m
    s: Floats  # (m, n) path coordinate
    speed: Floats  # (m, n) along the path
    normal: Floats  # (m, n) contact force, N, positive on the lower track
    tension: Floats  # (m, n)
    acceleration: Floats  # (nv,) of the last step
    direction: Floats  # (m, n, 2) of the links
    force: Floats  # (m, n, 2)
    inverse: Floats  # (m, n, 3): xx, xz, zz of an end's effective inverse mass
    work: Floats  # (8, n)


def make_state(n_sides: int, n_axles: int, n_coordinates: int) -> State:
    """Return an empty state for ``n_axles`` axles."""
    shape = (n_sides, n_axles)
    return State(
        rack=np.zeros(3),
        segment=np.zeros(shape, np.int64),
        dog=np.full(shape, NO_DOG, np.int64),
        roll=np.zeros(shape),
        s=np.zeros(shape),
        speed=np.zeros(shape),
        normal=np.zeros(shape),
        tension=np.zeros(shape),
        acceleration=np.zeros(n_coordinates),
        direction=np.zeros((*shape, 2)),
        force=np.zeros((*shape, 2)),
        inverse=np.zeros((*shape, 3)),
        work=np.zeros((8, n_axles)),
    )


@numba.njit(cache=True)
def table_at(tables, row, position, per_m):
    """Return value and slope of a periodic table by cubic Hermite.

    Parameters
    ----------
    tables : (m, n, 2) float64
        Values and slopes (per m) on even grids.
    row : int
    position : float
        In steps of the grid.
    per_m : float
        Grid steps per metre.
    """
    n = tables.shape[1]
    low = int(np.floor(position))
    t = position - low
    i = low % n
    j = i + 1 if i + 1 < n else 0
    v0, v1 = tables[row, i, 0], tables[row, j, 0]
    g0, g1 = tables[row, i, 1], tables[row, j, 1]
    rest = 1.0 - t
    value = v0 * (1.0 + 2.0 * t) * rest * rest + v1 * t * t * (3.0 - 2.0 * t)
    value += t * rest * (g0 * rest - g1 * t) / per_m
    slope = 6.0 * t * rest * (v1 - v0) * per_m
    slope += g0 * rest * (1.0 - 3.0 * t) + g1 * t * (3.0 * t - 2.0)
    return value, slope


@numba.njit(cache=True)
def ramp(s, start, end, length):
    """Return the share, 0 to 1, of a stretch with linear ramps inside its ends."""
    inside = min(s - start, end - s)
    if inside <= 0.0:
        return 0.0
    return 1.0 if inside >= length else inside / length


@numba.njit(cache=True)
def tread(turn, eccentricity, phase, flat, flat_phase):
    """Return by how much a roller's radius exceeds the nominal one at its contact, m.

    Parameters
    ----------
    turn : float
        Angle rolled, rad.
    eccentricity, phase, flat, flat_phase : float
        Amplitude and depth in m, phases in rad.
    """
    excess = eccentricity * np.sin(turn + phase)
    angle = (turn + flat_phase + np.pi) % (2.0 * np.pi) - np.pi
    if abs(angle) < FLAT_HALF_WIDTH:
        excess -= flat * 0.5 * (1.0 + np.cos(np.pi * angle / FLAT_HALF_WIDTH))
    return excess


@numba.njit(cache=True)
def rack_speed(p, state):
    """Return the rack's speed with its ripple, m/s."""
    factor = 1.0
    for k in range(len(p.ripple)):
        factor += p.ripple[k, 0] * np.sin(
            2.0 * np.pi * p.ripple[k, 1] * state.rack[0] / p.pitch_m + p.ripple[k, 2]
        )
    for k in range(len(p.hunting)):
        factor += p.hunting[k, 0] * np.sin(
            2.0 * np.pi * p.hunting[k, 1] * state.rack[1] + p.hunting[k, 2]
        )
    return p.speed * factor


@numba.njit(cache=True)
def rolling_drag(v, normal, law, extra, creep_speed, viscous):
    """Return the force along the path of one roller: dry, saturating with speed, and viscous."""
    return -(law * abs(normal) + extra) * np.tanh(v / creep_speed) - viscous * v


@numba.njit(cache=True)
def stretch_drag(s, stretches):
    """Return the extra dry drag, N, of a roller at ``s`` in rows of (from, to, force)."""
    total = 0.0
    for k in range(len(stretches)):
        if stretches[k, 0] <= s <= stretches[k, 1]:
            total += stretches[k, 2]
    return total


@numba.njit(cache=True)
def end_forces(p, state, q, v, w, h, base):
    """Fill force and effective inverse mass of every axle end from guide and drive.

    Returns
    -------
    on_carriage, on_frame : float
        Reactions along their coordinates, N.
    """
    # Arrays are taken out of the tuples once: to hand a tuple to a function that is not inlined
    # costs more than the function.
    segments, survey, length_m, end_mass = p.segments, p.survey, p.length_m, p.end_mass
    law_of, drag_of, eccentricity, flat = (
        p.rolling_resistance, p.roller_drag, p.eccentricity, p.flat,
    )  # fmt: skip
    guide_drag, creep, viscous = p.guide_drag, p.creep_speed, p.viscous_drag
    k_n, c_n, clearance = p.contact_stiffness, p.contact_damping, p.half_clearance
    k_d, c_d, pitch = p.drive_stiffness, p.drive_damping, p.pitch_m
    start, end, ramp_m = p.drive_start, p.drive_end, p.drive_ramp
    hints, dogs, roll, places = state.segment, state.dog, state.roll, state.s
    speeds, normals, force, inverse = state.speed, state.normal, state.force, state.inverse
    rack, rack_v, relaxing = state.rack[0], rack_speed(p, state), state.rack[2]
    m, n = places.shape
    stride = 1 + 2 * m
    frame = base == 2
    u, lift = q[0], q[1] if frame else 0.0
    v_u, v_lift = v[0], v[1] if frame else 0.0
    per_m = survey.shape[1] / length_m
    gamma = 0.5 * h * c_n + 0.25 * h * h * k_n
    tau = 0.5 * h * c_d + 0.25 * h * h * k_d
    friction_rise, friction_speed = p.friction_rise, p.friction_speed
    on_carriage, on_frame = 0.0, 0.0
    for side in range(m):
        for i in range(n):
            j = base + i * stride + 1 + 2 * side
            x, z = q[j], q[j + 1]
            k, local, offset, tx, tz = find_segment(segments, hints[side, i], x, z, u, lift)
            hints[side, i] = k
            s = segments[k, START] + local * segments[k, SCALE]
            moves = segments[k, CARRIAGE]
            places[side, i] = s
            v_t = (v[j] + moves * v_u) * tx + (v[j + 1] - v_lift) * tz
            v_n = (v[j + 1] - v_lift) * tx - (v[j] + moves * v_u) * tz
            w_t = v_t + (w[j] - v[j]) * tx + (w[j + 1] - v[j + 1]) * tz
            w_n = v_n + (w[j + 1] - v[j + 1]) * tx - (w[j] - v[j]) * tz
            speeds[side, i] = v_t
            # normal contact along n = (-tz, tx): free within the clearance, never pulling
            value, slope = table_at(survey, side, s * per_m, per_m)
            gap, moving = offset - value, slope * v_t
            half = clearance
            if eccentricity[side, i, 0] != 0.0 or flat[side, i, 0] != 0.0:
                half -= tread(
                    roll[side, i] / p.roller_radius, eccentricity[side, i, 0],
                    eccentricity[side, i, 1], flat[side, i, 0], flat[side, i, 1],
                )  # fmt: skip
            normal, push, stiff = 0.0, 0.0, 0.0
            if abs(gap) > half:
                sign = -1.0 if gap < 0.0 else 1.0
                spring = -k_n * (gap - sign * half)
                normal = spring - c_n * (v_n - moving)
                if normal * sign < 0.0:
                    push = spring - c_n * (w_n - moving)
                    stiff = gamma
                else:
                    normal = 0.0
            normals[side, i] = normal
            rolling = v_t + relaxing
            law, extra = law_of[side, i], drag_of[side, i]
            if friction_rise != 0.0:
                law *= 1.0 + friction_rise * np.exp(-abs(rolling) / friction_speed)
            if len(guide_drag):
                extra += stretch_drag(s % length_m, guide_drag)
            along = rolling_drag(rolling, normal, law, extra, creep, viscous)
            # drive: the dog nearest at entry, held until the axle leaves
            engaged = ramp(s, start, end, ramp_m)
            if engaged > 0.0:
                if dogs[side, i] == NO_DOG:
                    dogs[side, i] = int(np.floor((s - rack) / pitch + 0.5))
                ahead = rack + dogs[side, i] * pitch - s
                along += engaged * (k_d * ahead + c_d * (rack_v - w_t))
            else:
                dogs[side, i] = NO_DOG
            fx, fz = along * tx - push * tz, along * tz + push * tx
            on_carriage += moves * fx
            on_frame -= fz
            mass = end_mass[side, i]
            force[side, i, 0] = fx
            force[side, i, 1] = fz - mass * p.gravity
            b_n, b_t = 1.0 / (mass + stiff), 1.0 / (mass + engaged * tau)
            inverse[side, i, 0] = b_n * tz * tz + b_t * tx * tx
            inverse[side, i, 1] = (b_t - b_n) * tx * tz
            inverse[side, i, 2] = b_n * tx * tx + b_t * tz * tz
    return on_carriage, on_frame


@numba.njit(cache=True)
def add_loads(p, state):
    """Add the weight on each step to its axles, where the step is on the loaded stretch."""
    m, n = state.s.shape
    for side in range(m):
        for i in range(n):
            weight = p.load[side, i]
            if weight == 0.0:
                continue
            j = i + 1 if i + 1 < n else 0
            ahead = (state.s[side, j] - state.s[side, i]) % p.length_m
            middle = (state.s[side, i] + 0.5 * ahead) % p.length_m
            share = 0.5 * weight * ramp(middle, p.load_from, p.load_to, p.load_ramp)
            state.force[side, i, 1] -= share
            state.force[side, j, 1] -= share


@numba.njit(cache=True)
def add_racking(p, state, q, v, base):
    """Add the spring between the two ends of each axle, in the plane."""
    n = state.s.shape[1]
    for i in range(n):
        j = base + i * 5 + 1
        for c in range(2):
            f = p.racking_stiffness * (q[j + c] - q[j + 2 + c])
            f += p.racking_damping * (v[j + c] - v[j + 2 + c])
            state.force[0, i, c] -= f
            state.force[1, i, c] += f


@numba.njit(cache=True)
def link_forces(p, state, q, w, base):
    """Fill the links' directions and their forces at the mid-step velocity; add them."""
    m, n = state.s.shape
    stride = 1 + 2 * m
    for side in range(m):
        for i in range(n):
            k = i + 1 if i + 1 < n else 0
            a = base + i * stride + 1 + 2 * side
            b = base + k * stride + 1 + 2 * side
            dx, dz = q[b] - q[a], q[b + 1] - q[a + 1]
            length = np.sqrt(dx * dx + dz * dz)
            ex, ez = dx / length, dz / length
            rate = (w[b] - w[a]) * ex + (w[b + 1] - w[a + 1]) * ez
            pull = p.link_stiffness[side, i] * (length - p.link_length[side, i])
            pull += p.link_damping[side, i] * rate
            state.direction[side, i, 0], state.direction[side, i, 1] = ex, ez
            state.tension[side, i] = pull
            state.force[side, i, 0] += pull * ex
            state.force[side, i, 1] += pull * ez
            state.force[side, k, 0] -= pull * ex
            state.force[side, k, 1] -= pull * ez


@numba.njit(cache=True)
def solve_cyclic(diagonal, upper, right, solution, a, b):
    """Solve a symmetric cyclic tridiagonal system by Sherman and Morrison, in place.

    ``upper[i]`` couples rows i and i + 1 (mod n); ``a`` and ``b`` are work arrays.
    """
    n = len(diagonal)
    corner = upper[n - 1]
    shift = -diagonal[0]
    # rank-one correction (shift, 0, ..., corner) takes the corners off
    pivot = diagonal[0] - shift
    solution[0] = right[0] / pivot
    b[0] = shift / pivot
    for i in range(1, n):
        last = diagonal[i] if i < n - 1 else diagonal[i] - corner * corner / shift
        a[i] = upper[i - 1] / pivot
        pivot = last - upper[i - 1] * a[i]
        solution[i] = (right[i] - upper[i - 1] * solution[i - 1]) / pivot
        extra = corner if i == n - 1 else 0.0
        b[i] = (extra - upper[i - 1] * b[i - 1]) / pivot
    for i in range(n - 2, -1, -1):
        solution[i] -= a[i + 1] * solution[i + 1]
        b[i] -= a[i + 1] * b[i + 1]
    ratio = corner / shift
    factor = (solution[0] + ratio * solution[n - 1]) / (1.0 + b[0] + ratio * b[n - 1])
    for i in range(n):
        solution[i] -= factor * b[i]


@numba.njit(cache=True)
def solve_side(p, state, side, h, out, base):
    """Solve the implicit step of one side's chain and write its accelerations."""
    m, n = state.s.shape
    stride = 1 + 2 * m
    diagonal, upper, right = state.work[0], state.work[1], state.work[2]
    solution, free_x, free_z = state.work[3], state.work[4], state.work[5]
    inverse, force, e = state.inverse[side], state.force[side], state.direction[side]
    for i in range(n):
        free_x[i] = inverse[i, 0] * force[i, 0] + inverse[i, 1] * force[i, 1]
        free_z[i] = inverse[i, 1] * force[i, 0] + inverse[i, 2] * force[i, 1]
    for i in range(n):
        k = i + 1 if i + 1 < n else 0
        ex, ez = e[i, 0], e[i, 1]
        alpha = 0.5 * h * p.link_damping[side, i] + 0.25 * h * h * p.link_stiffness[side, i]
        xx, xz = inverse[k, 0] * ex + inverse[k, 1] * ez, inverse[k, 1] * ex + inverse[k, 2] * ez
        here_x = inverse[i, 0] * ex + inverse[i, 1] * ez
        here_z = inverse[i, 1] * ex + inverse[i, 2] * ez
        diagonal[i] = 1.0 / alpha + ex * (xx + here_x) + ez * (xz + here_z)
        upper[i] = -(xx * e[k, 0] + xz * e[k, 1])
        right[i] = ex * (free_x[k] - free_x[i]) + ez * (free_z[k] - free_z[i])
    solve_cyclic(diagonal, upper, right, solution, state.work[6], state.work[7])
    for i in range(n):
        k = i - 1 if i > 0 else n - 1
        fx = solution[i] * e[i, 0] - solution[k] * e[k, 0]
        fz = solution[i] * e[i, 1] - solution[k] * e[k, 1]
        j = base + i * stride + 1 + 2 * side
        out[j] = free_x[i] + inverse[i, 0] * fx + inverse[i, 1] * fz
        out[j + 1] = free_z[i] + inverse[i, 1] * fx + inverse[i, 2] * fz


@numba.njit(cache=True)
def lateral_step(p, state, q, w, h, out, base):
    """Write the lateral accelerations: mass against a spring-damper to the guide's line."""
    m, n = state.s.shape
    stride = 1 + 2 * m
    per_m = p.lateral.shape[1] / p.length_m
    stiff = 0.5 * h * p.lateral_damping + 0.25 * h * h * p.lateral_stiffness
    for i in range(n):
        j = base + i * stride
        line, slope = table_at(p.lateral, 0, state.s[0, i] * per_m, per_m)
        mass = 0.0
        for side in range(m):
            mass += p.end_mass[side, i]
        pull = p.lateral_stiffness * (line - q[j])
        pull += p.lateral_damping * (slope * state.speed[0, i] - w[j])
        out[j] = pull / (mass + stiff)


@numba.njit(cache=True)
def carriage_step(p, q, w, h, reaction):
    """Return the carriage's acceleration; dry friction sticks or slides (set-valued)."""
    push = p.preload - p.carriage_stiffness * q[0] - p.carriage_damping * w[0] + reaction
    if q[0] > p.carriage_stop:
        push -= max(p.stop_stiffness * (q[0] - p.carriage_stop) + p.stop_damping * w[0], 0.0)
    mass = p.carriage_mass + 0.5 * h * p.carriage_damping + 0.25 * h * h * p.carriage_stiffness
    free = w[0] + h * push / mass
    dry = h * p.carriage_friction / mass
    if abs(free) <= dry:
        return -w[0] / h
    return (free - np.sign(free) * dry - w[0]) / h


@numba.njit(cache=True)
def accelerations(p, state, q, w, v, h, out):
    """Evaluate the law at ``q`` with mid-step velocity ``w``; write accelerations to ``out``.

    ``v`` receives the velocity at the step itself, extrapolated, for the explicit terms.
    """
    base = 2 if p.frame[0] > 0.0 else 1
    for i in range(len(v)):
        v[i] = w[i] + 0.5 * h * state.acceleration[i]
    on_carriage, on_frame = end_forces(p, state, q, v, w, h, base)
    add_loads(p, state)
    if p.n_sides == 2:
        add_racking(p, state, q, v, base)
    link_forces(p, state, q, w, base)
    for side in range(p.n_sides):
        solve_side(p, state, side, h, out, base)
    lateral_step(p, state, q, w, h, out, base)
    out[0] = carriage_step(p, q, w, h, on_carriage)
    if base == 2:
        mass, stiffness, damping = p.frame
        push = on_frame - stiffness * q[1] - damping * w[1]
        out[1] = push / (mass + 0.5 * h * damping + 0.25 * h * h * stiffness)
    for i in range(len(v)):
        state.acceleration[i] = out[i]
        v[i] = w[i] + 0.5 * h * out[i]
    correct_tension(p, state, h, out, base)


@numba.njit(cache=True)
def correct_tension(p, state, h, out, base):
    """Move the links' damper force from the mid-step velocity to the step itself."""
    tension, direction, damping = state.tension, state.direction, p.link_damping
    m, n = state.s.shape
    stride = 1 + 2 * m
    for side in range(m):
        for i in range(n):
            k = i + 1 if i + 1 < n else 0
            a = base + i * stride + 1 + 2 * side
            b = base + k * stride + 1 + 2 * side
            rate = (out[b] - out[a]) * direction[side, i, 0]
            rate += (out[b + 1] - out[a + 1]) * direction[side, i, 1]
            tension[side, i] += 0.5 * h * damping[side, i] * rate
