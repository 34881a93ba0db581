"""Forces inside the chain: links, axles' racking, loads; and the implicit step that couples them.

Rows run over the axles or links of one side: all but the elimination itself is done to several of
them at once. Link ``i`` leads from axle ``i`` to the next; the last one closes the loop.
"""

import numpy as np

from escalator_twin.physics.compiled import compiled, inlined
from escalator_twin.physics.contact import ramp
from escalator_twin.physics.state import State
from escalator_twin.signals import Floats

# Rows of the links' system: what becomes the inverse of the pivot, coupling to the next link, their product,
# the corner's column, then the sought forces: without moving parts, and for an acceleration of up to two.
PIVOT, NEXT, FACTOR, CORNER, FORCED = range(5)


@compiled
def add_loads(
    force: Floats,
    s: Floats,
    load: Floats,
    length_m: float,
    start: float,
    end: float,
    ramp_m: float,
) -> None:
    """Add the weight on each step to its axles, where the step is on the loaded stretch."""
    m, n = s.shape
    for side in range(m):
        for i in range(n):
            weight = load[side, i]
            if weight == 0.0:
                continue
            j = i + 1 if i + 1 < n else 0
            ahead = s[side, j] - s[side, i]
            if ahead < 0.0:
                ahead += length_m
            middle = s[side, i] + 0.5 * ahead
            if middle >= length_m:
                middle -= length_m
            share = 0.5 * weight * ramp(middle, start, end, ramp_m)
            force[1, side, i] -= share
            force[1, side, j] -= share


@compiled
def add_racking(
    force: Floats, place: Floats, rate: Floats, stiffness: float, damping: float
) -> None:
    """Add the spring between the two ends of each axle, in the plane."""
    for c in range(2):
        left, right, v_left, v_right = place[c, 0], place[c, 1], rate[c, 0], rate[c, 1]
        on_left, on_right = force[c, 0], force[c, 1]
        for i in range(len(left)):
            f = stiffness * (left[i] - right[i]) + damping * (v_left[i] - v_right[i])
            on_left[i] -= f
            on_right[i] += f


@inlined
def link_forces(state: State, law: tuple[Floats, Floats, Floats], h: float) -> None:
    """Fill the links' directions and forces, and add them to the axle ends.

    The spring is taken at the mean of the length, ``length + h^2/4 length''``; the part of
    ``length''`` that comes from turning is known. ``law`` holds stiffness, damping and free length
    of every link, (m, n) each.
    """
    pull = state.work[FORCED]
    for side in range(len(pull)):
        last = pull.shape[1] - 1
        pull_links(state.place, state.rate, state.middle, state.direction, law, h, state.tension,
                   pull, side, 0, last, 1)  # fmt: skip
        pull_links(state.place, state.rate, state.middle, state.direction, law, h, state.tension,
                   pull, side, last, last + 1, -last)  # fmt: skip
        along = pull[side]
        for c in range(2):
            add_pulls(state.force[c, side], state.direction[c, side], along)


@compiled
def pull_links(
    place: Floats, rate: Floats, middle: Floats, direction: Floats,
    law: tuple[Floats, Floats, Floats], h: float, tension: Floats, pull: Floats, side: int,
    begin: int, end: int, ahead: int,
) -> None:  # fmt: skip
    """Fill direction, force and force at the mean length of links whose end is ``ahead`` axles on."""
    stiffness, damping, free_length = law[0][side], law[1][side], law[2][side]
    x, z, vx, vz = place[0, side], place[1, side], rate[0, side], rate[1, side]
    wx, wz, ex_of, ez_of = middle[0, side], middle[1, side], direction[0, side], direction[1, side]
    tensions, pulls = tension[side], pull[side]
    turning = 0.25 * h * h
    for i in range(begin, end):
        k = i + ahead
        dx, dz = x[k] - x[i], z[k] - z[i]
        length = np.sqrt(dx * dx + dz * dz)
        per_length = 1.0 / length
        ex, ez = dx * per_length, dz * per_length
        stretch_rate = (wx[k] - wx[i]) * ex + (wz[k] - wz[i]) * ez
        turn = (vz[k] - vz[i]) * ex - (vx[k] - vx[i]) * ez
        f = stiffness[i] * (length - free_length[i]) + damping[i] * stretch_rate
        ex_of[i], ez_of[i], tensions[i] = ex, ez, f
        pulls[i] = f + turning * stiffness[i] * turn * turn * per_length


@compiled
def add_pulls(onto: Floats, direction: Floats, pull: Floats) -> None:
    """Add the links' pulls, in one direction, to both ends of each link."""
    last = len(onto) - 1
    onto[0] += pull[0] * direction[0] - pull[last] * direction[last]
    for i in range(1, last + 1):
        onto[i] += pull[i] * direction[i] - pull[i - 1] * direction[i - 1]


@compiled
def accelerate(inverse: Floats, force: Floats, free: Floats, side: int) -> None:
    """Fill what one side's ends do under some forces, (2, m, n) each."""
    xx, xz, zz = inverse[0, side], inverse[1, side], inverse[2, side]
    fx, fz, ax, az = force[0, side], force[1, side], free[0, side], free[1, side]
    for i in range(len(xx)):
        ax[i] = xx[i] * fx[i] + xz[i] * fz[i]
        az[i] = xz[i] * fx[i] + zz[i] * fz[i]


@compiled
def free_accelerations(free: Floats, inverse: Floats, force: Floats, coupling: Floats) -> None:
    """Fill what each end would do without links: under its force, and for each coupling."""
    for side in range(force.shape[1]):
        accelerate(inverse, force, free[0], side)
        for c in range(len(coupling)):
            accelerate(inverse, coupling[c], free[1 + c], side)


@compiled
def fill_system(
    work: Floats, free: Floats, inverse: Floats, direction: Floats, stiffness: Floats,
    damping: Floats, h: float,
) -> None:  # fmt: skip
    """Fill the cyclic tridiagonal system of the links' force changes, one row a link."""
    m, n = stiffness.shape
    last = n - 1
    for side in range(m):
        pivot, corner = work[PIVOT, side], work[CORNER, side]
        per_link, rate = stiffness[side], damping[side]
        for i in range(n):
            pivot[i] = 1.0 / (0.5 * h * rate[i] + 0.25 * h * h * per_link[i])
            corner[i] = 0.0
        fill_links(work, inverse, direction, side, 0, last, 1)
        fill_links(work, inverse, direction, side, last, n, -last)
        for c in range(len(free)):
            ex, ez, forced = direction[0, side], direction[1, side], work[FORCED + c, side]
            ax, az = free[c, 0, side], free[c, 1, side]
            for i in range(last):
                forced[i] = ex[i] * (ax[i + 1] - ax[i]) + ez[i] * (az[i + 1] - az[i])
            forced[last] = ex[last] * (ax[0] - ax[last]) + ez[last] * (az[0] - az[last])


@compiled
def fill_links(
    work: Floats, inverse: Floats, direction: Floats, side: int, begin: int, end: int, ahead: int
) -> None:
    """Complete the pivots and fill the couplings of links whose end is ``ahead`` axles on."""
    pivot, coupled = work[PIVOT, side], work[NEXT, side]
    xx, xz, zz = inverse[0, side], inverse[1, side], inverse[2, side]
    ex_of, ez_of = direction[0, side], direction[1, side]
    for i in range(begin, end):
        k = i + ahead
        ex, ez, fx, fz = ex_of[i], ez_of[i], ex_of[k], ez_of[k]
        sx, sz = xx[k] * ex + xz[k] * ez, xz[k] * ex + zz[k] * ez
        own = ex * (xx[i] * ex + xz[i] * ez) + ez * (xz[i] * ex + zz[i] * ez)
        pivot[i] += own + ex * sx + ez * sz
        coupled[i] = -(fx * sx + fz * sz)


@compiled
def solve_cyclic(work: Floats) -> None:
    """Solve the symmetric cyclic tridiagonal systems by Sherman and Morrison, in place.

    A rank-one change takes the corners off.
    """
    width, m, n = work.shape
    last = n - 1
    for side in range(m):
        pivot, coupled, corner = work[PIVOT, side], work[NEXT, side], work[CORNER, side]
        shift, end = -pivot[0], coupled[last]
        pivot[last] -= end * end / shift
        corner[last] = end
        corner[0] = shift
        pivot[0] -= shift
        eliminate(pivot, coupled, work[FACTOR, side])
        substitute(corner, work[FORCED, side], work[FACTOR, side], pivot)
        substitute(work[FORCED + 1, side], work[FORCED + 2, side], work[FACTOR, side], pivot)
        # shift is minus the first pivot before it was doubled, the pivot now its inverse
        ratio = -2.0 * end * pivot[0]
        below = 1.0 / (1.0 + corner[0] + ratio * corner[last])
        for c in range(FORCED, width):
            row = work[c, side]
            share = (row[0] + ratio * row[last]) * below
            for i in range(n):
                row[i] -= share * corner[i]


@compiled
def eliminate(pivot: Floats, coupled: Floats, factor: Floats) -> None:
    """Put the inverse pivots of a tridiagonal system in the place of its diagonal; fill the factors."""
    n = len(pivot)
    value = pivot[0]
    for i in range(1, n):
        value = pivot[i] - coupled[i - 1] * coupled[i - 1] / value
        pivot[i] = value
    for i in range(n):
        pivot[i] = 1.0 / pivot[i]
        factor[i] = coupled[i] * pivot[i]


@compiled
def substitute(one: Floats, other: Floats, factor: Floats, pivot: Floats) -> None:
    """Solve for two right sides at once, in place: each waits for its own products only."""
    n = len(one)
    a, b = one[0], other[0]
    for i in range(1, n):
        a, b = one[i] - factor[i - 1] * a, other[i] - factor[i - 1] * b
        one[i], other[i] = a, b
    for i in range(n):
        one[i] *= pivot[i]
        other[i] *= pivot[i]
    a, b = one[n - 1], other[n - 1]
    for i in range(n - 2, -1, -1):
        a, b = one[i] - factor[i] * a, other[i] - factor[i] * b
        one[i], other[i] = a, b


@compiled
def link_up(work: Floats, direction: Floats, inverse: Floats, free: Floats, pulls: Floats) -> None:
    """Add what the links do to the ends' accelerations: of the forces, and for each coupling.

    ``pulls`` is room for forces, (2, m, n).
    """
    for side in range(work.shape[1]):
        for c in range(len(free)):
            for d in range(2):
                pulls[d, side] = 0.0
                add_pulls(pulls[d, side], direction[d, side], work[FORCED + c, side])
            xx, xz, zz = inverse[0, side], inverse[1, side], inverse[2, side]
            fx, fz, ax, az = pulls[0, side], pulls[1, side], free[c, 0, side], free[c, 1, side]
            for i in range(len(xx)):
                ax[i] += xx[i] * fx[i] + xz[i] * fz[i]
                az[i] += xz[i] * fx[i] + zz[i] * fz[i]


@compiled
def settle_parts(free: Floats, coupling: Floats, reaction: Floats, inertia: Floats) -> None:
    """Take the chain out of the moving parts' equations: complete their forces and inertias."""
    for c in range(len(coupling)):
        for side in range(coupling.shape[2]):
            gx, gz = coupling[c, 0, side], coupling[c, 1, side]
            reaction[c] += along(gx, gz, free[0, 0, side], free[0, 1, side])
            for d in range(c, len(coupling)):
                inertia[c, d] -= along(gx, gz, free[1 + d, 0, side], free[1 + d, 1, side])


@compiled
def along(gx: Floats, gz: Floats, ax: Floats, az: Floats) -> float:
    """Return the sum of the products of two rows of vectors."""
    total = 0.0
    for i in range(len(gx)):
        total += gx[i] * ax[i] + gz[i] * az[i]
    return total


@compiled
def write_accelerations(out: Floats, free: Floats) -> None:
    """Write the ends' accelerations; those of the moving parts are in ``out`` already."""
    parts, _, m, n = free.shape
    base, stride = parts - 1, 1 + 2 * m
    for d in range(2):
        for side in range(m):
            own = free[0, d, side]
            for c in range(1, parts):
                moved, of_part = free[c, d, side], out[c - 1]
                for i in range(n):
                    own[i] += of_part * moved[i]
            first = base + 1 + 2 * side + d
            for i in range(n):
                out[first + i * stride] = own[i]


@compiled
def correct_tension(
    tension: Floats, direction: Floats, damping: Floats, free: Floats, h: float
) -> None:
    """Move the links' damper force from the mid-step velocity to the step itself."""
    m, n = tension.shape
    last = n - 1
    for side in range(m):
        pull, rate, ex, ez = tension[side], damping[side], direction[0, side], direction[1, side]
        ax, az = free[0, 0, side], free[0, 1, side]
        for i in range(last):
            opening = (ax[i + 1] - ax[i]) * ex[i] + (az[i + 1] - az[i]) * ez[i]
            pull[i] += 0.5 * h * rate[i] * opening
        opening = (ax[0] - ax[last]) * ex[last] + (az[0] - az[last]) * ez[last]
        pull[last] += 0.5 * h * rate[last] * opening
