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
    far, to = begin + ahead, end + ahead
    stiffness, damping = law[0][side, begin:end], law[1][side, begin:end]
    free_length, turning = law[2][side, begin:end], 0.25 * h * h
    # rows of both ends: an index that might be negative would have the links taken one by one
    x, z, x_far, z_far = (
        place[0, side, begin:end], place[1, side, begin:end],
        place[0, side, far:to], place[1, side, far:to],
    )  # fmt: skip
    vx, vz, vx_far, vz_far = (
        rate[0, side, begin:end], rate[1, side, begin:end],
        rate[0, side, far:to], rate[1, side, far:to],
    )  # fmt: skip
    wx, wz, wx_far, wz_far = (
        middle[0, side, begin:end], middle[1, side, begin:end],
        middle[0, side, far:to], middle[1, side, far:to],
    )  # fmt: skip
    ex_of, ez_of = direction[0, side, begin:end], direction[1, side, begin:end]
    tensions, pulls = tension[side, begin:end], pull[side, begin:end]
    for i in range(len(x)):
        dx, dz = x_far[i] - x[i], z_far[i] - z[i]
        length = np.sqrt(dx * dx + dz * dz)
        per_length = 1.0 / length
        ex, ez = dx * per_length, dz * per_length
        stretch_rate = (wx_far[i] - wx[i]) * ex + (wz_far[i] - wz[i]) * ez
        turn = (vz_far[i] - vz[i]) * ex - (vx_far[i] - vx[i]) * ez
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
    far, to = begin + ahead, end + ahead
    pivot, coupled = work[PIVOT, side, begin:end], work[NEXT, side, begin:end]
    xx, xz, zz = (
        inverse[0, side, begin:end], inverse[1, side, begin:end], inverse[2, side, begin:end],
    )  # fmt: skip
    xx_far, xz_far, zz_far = (
        inverse[0, side, far:to],
        inverse[1, side, far:to],
        inverse[2, side, far:to],
    )
    ex_of, ez_of = direction[0, side, begin:end], direction[1, side, begin:end]
    fx_of, fz_of = direction[0, side, far:to], direction[1, side, far:to]
    for i in range(len(pivot)):
        ex, ez = ex_of[i], ez_of[i]
        sx, sz = xx_far[i] * ex + xz_far[i] * ez, xz_far[i] * ex + zz_far[i] * ez
        own = ex * (xx[i] * ex + xz[i] * ez) + ez * (xz[i] * ex + zz[i] * ez)
        pivot[i] += own + ex * sx + ez * sz
        coupled[i] = -(fx_of[i] * sx + fz_of[i] * sz)


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
    if m == 2:
        eliminate_both(work[PIVOT], work[NEXT], work[FACTOR])
        substitute_both(work[CORNER:width], work[FACTOR], work[PIVOT])
    else:
        factor, inverse = work[FACTOR, 0], work[PIVOT, 0]
        eliminate(inverse, work[NEXT, 0], factor)
        substitute(work[CORNER, 0], work[FORCED, 0], factor, inverse)
        substitute(work[FORCED + 1, 0], work[FORCED + 2, 0], factor, inverse)
    for side in range(m):
        pivot, corner, end = work[PIVOT, side], work[CORNER, side], work[NEXT, side, last]
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
def eliminate_both(pivot: Floats, coupled: Floats, factor: Floats) -> None:
    """Do the same for two systems at once, (2, n): while one's division is under way, the other's begins."""
    n = pivot.shape[1]
    a, b = pivot[0, 0], pivot[1, 0]
    for i in range(1, n):
        a = pivot[0, i] - coupled[0, i - 1] * coupled[0, i - 1] / a
        b = pivot[1, i] - coupled[1, i - 1] * coupled[1, i - 1] / b
        pivot[0, i], pivot[1, i] = a, b
    for side in range(2):
        of_side, couplings, factors = pivot[side], coupled[side], factor[side]
        for i in range(n):
            of_side[i] = 1.0 / of_side[i]
            factors[i] = couplings[i] * of_side[i]


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
def substitute_both(rows: Floats, factor: Floats, pivot: Floats) -> None:
    """Solve two systems at once, for four right sides each, (4, 2, n), in place."""
    n = rows.shape[2]
    a, b, c, d = rows[0, 0, 0], rows[1, 0, 0], rows[2, 0, 0], rows[3, 0, 0]
    e, f, g, k = rows[0, 1, 0], rows[1, 1, 0], rows[2, 1, 0], rows[3, 1, 0]
    for i in range(1, n):
        one, other = factor[0, i - 1], factor[1, i - 1]
        a, b = rows[0, 0, i] - one * a, rows[1, 0, i] - one * b
        c, d = rows[2, 0, i] - one * c, rows[3, 0, i] - one * d
        e, f = rows[0, 1, i] - other * e, rows[1, 1, i] - other * f
        g, k = rows[2, 1, i] - other * g, rows[3, 1, i] - other * k
        rows[0, 0, i], rows[1, 0, i], rows[2, 0, i], rows[3, 0, i] = a, b, c, d
        rows[0, 1, i], rows[1, 1, i], rows[2, 1, i], rows[3, 1, i] = e, f, g, k
    for j in range(4):
        for side in range(2):
            row, inverse = rows[j, side], pivot[side]
            for i in range(n):
                row[i] *= inverse[i]
    last = n - 1
    a, b, c, d = rows[0, 0, last], rows[1, 0, last], rows[2, 0, last], rows[3, 0, last]
    e, f, g, k = rows[0, 1, last], rows[1, 1, last], rows[2, 1, last], rows[3, 1, last]
    for i in range(n - 2, -1, -1):
        one, other = factor[0, i], factor[1, i]
        a, b = rows[0, 0, i] - one * a, rows[1, 0, i] - one * b
        c, d = rows[2, 0, i] - one * c, rows[3, 0, i] - one * d
        e, f = rows[0, 1, i] - other * e, rows[1, 1, i] - other * f
        g, k = rows[2, 1, i] - other * g, rows[3, 1, i] - other * k
        rows[0, 0, i], rows[1, 0, i], rows[2, 0, i], rows[3, 0, i] = a, b, c, d
        rows[0, 1, i], rows[1, 1, i], rows[2, 1, i], rows[3, 1, i] = e, f, g, k


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
