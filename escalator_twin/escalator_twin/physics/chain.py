"""Forces inside the chain: links, axles' racking, loads; and the implicit step that couples them."""

import numpy as np

from escalator_twin.physics.compiled import compiled
from escalator_twin.physics.contact import ramp
from escalator_twin.signals import Floats

# Columns of a link's row: pivot, coupling to the next link, then solutions.
PIVOT, NEXT, CORNER, FORCED = range(4)


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
            force[side, i, 1] -= share
            force[side, j, 1] -= share


@compiled
def add_racking(
    force: Floats, q: Floats, v: Floats, stiffness: float, damping: float, base: int
) -> None:
    """Add the spring between the two ends of each axle, in the plane."""
    for i in range(force.shape[1]):
        j = base + i * 5 + 1
        for c in range(2):
            f = stiffness * (q[j + c] - q[j + 2 + c]) + damping * (v[j + c] - v[j + 2 + c])
            force[0, i, c] -= f
            force[1, i, c] += f


@compiled
def link_forces(
    force: Floats, direction: Floats, tension: Floats, q: Floats, v: Floats, w: Floats, h: float,
    base: int, law: tuple[Floats, Floats, Floats],
) -> None:  # fmt: skip
    """Fill the links' directions and forces, and add them to the axle ends.

    The spring is taken at the mean of the length, ``length + h^2/4 length''``; the part of
    ``length''`` that comes from turning is known. ``law`` holds stiffness, damping and free length
    of every link, (m, n) each.
    """
    stiffness, damping, free_length = law
    m, n = tension.shape
    stride = 1 + 2 * m
    for side in range(m):
        for i in range(n):
            k = i + 1 if i + 1 < n else 0
            a, b = base + i * stride + 1 + 2 * side, base + k * stride + 1 + 2 * side
            dx, dz = q[b] - q[a], q[b + 1] - q[a + 1]
            length = np.sqrt(dx * dx + dz * dz)
            per_length = 1.0 / length
            ex, ez = dx * per_length, dz * per_length
            rate = (w[b] - w[a]) * ex + (w[b + 1] - w[a + 1]) * ez
            turn = (v[b + 1] - v[a + 1]) * ex - (v[b] - v[a]) * ez
            pull = stiffness[side, i] * (length - free_length[side, i])
            pull += damping[side, i] * rate
            direction[side, i, 0], direction[side, i, 1] = ex, ez
            tension[side, i] = pull
            pull += 0.25 * h * h * stiffness[side, i] * turn * turn * per_length
            force[side, i, 0] += pull * ex
            force[side, i, 1] += pull * ez
            force[side, k, 0] -= pull * ex
            force[side, k, 1] -= pull * ez


@compiled
def free_accelerations(free: Floats, inverse: Floats, force: Floats, coupling: Floats) -> None:
    """Fill what each end would do without links: under its force, and for each coupling."""
    m, n, columns, _ = free.shape
    for side in range(m):
        for i in range(n):
            xx, xz, zz = inverse[side, i, 0], inverse[side, i, 1], inverse[side, i, 2]
            fx, fz = force[side, i, 0], force[side, i, 1]
            free[side, i, 0, 0], free[side, i, 0, 1] = xx * fx + xz * fz, xz * fx + zz * fz
            for c in range(columns - 1):
                fx, fz = coupling[side, i, c, 0], coupling[side, i, c, 1]
                free[side, i, 1 + c, 0] = xx * fx + xz * fz
                free[side, i, 1 + c, 1] = xz * fx + zz * fz


@compiled
def fill_system(
    work: Floats, free: Floats, inverse: Floats, direction: Floats, stiffness: Floats,
    damping: Floats, h: float,
) -> None:  # fmt: skip
    """Fill the cyclic tridiagonal system of the links' force changes, one row a link."""
    m, n, width = work.shape
    for side in range(m):
        for i in range(n):
            k = i + 1 if i + 1 < n else 0
            ex, ez = direction[side, i, 0], direction[side, i, 1]
            alpha = 0.5 * h * damping[side, i] + 0.25 * h * h * stiffness[side, i]
            a, b = inverse[side, i], inverse[side, k]
            xx, xz, zz = a[0] + b[0], a[1] + b[1], a[2] + b[2]
            row = work[side, i]
            row[PIVOT] = 1.0 / alpha + ex * (xx * ex + xz * ez) + ez * (xz * ex + zz * ez)
            fx, fz = direction[side, k, 0], direction[side, k, 1]
            row[NEXT] = -(ex * (b[0] * fx + b[1] * fz) + ez * (b[1] * fx + b[2] * fz))
            row[CORNER] = 0.0
            for c in range(width - FORCED):
                row[FORCED + c] = ex * (free[side, k, c, 0] - free[side, i, c, 0])
                row[FORCED + c] += ez * (free[side, k, c, 1] - free[side, i, c, 1])


@compiled
def solve_cyclic(work: Floats) -> None:
    """Solve the symmetric cyclic tridiagonal systems by Sherman and Morrison, in place.

    A rank-one change takes the corners off; the sides run side by side, since each waits for its
    own divisions.
    """
    m, n, width = work.shape
    last = n - 1
    for side in range(m):
        first, end = work[side, 0], work[side, last]
        shift, corner = -first[PIVOT], end[NEXT]
        end[PIVOT] -= corner * corner / shift
        end[CORNER] = corner
        first[CORNER] = shift
        first[PIVOT] = 1.0 / (first[PIVOT] - shift)
    for i in range(1, n):
        for side in range(m):
            here, before = work[side, i], work[side, i - 1]
            factor = before[NEXT] * before[PIVOT]
            here[PIVOT] = 1.0 / (here[PIVOT] - factor * before[NEXT])
            for c in range(CORNER, width):
                here[c] -= factor * before[c]
    for side in range(m):
        for c in range(CORNER, width):
            work[side, last, c] *= work[side, last, PIVOT]
    for i in range(n - 2, -1, -1):
        for side in range(m):
            here, after = work[side, i], work[side, i + 1]
            for c in range(CORNER, width):
                here[c] = (here[c] - here[NEXT] * after[c]) * here[PIVOT]
    for side in range(m):
        first, end = work[side, 0], work[side, last]
        # shift is minus the first pivot before it was doubled, the pivot now its inverse
        ratio = -2.0 * end[NEXT] * first[PIVOT]
        below = 1.0 / (1.0 + first[CORNER] + ratio * end[CORNER])
        for c in range(FORCED, width):
            factor = (first[c] + ratio * end[c]) * below
            for i in range(n):
                work[side, i, c] -= factor * work[side, i, CORNER]


@compiled
def pulled(
    work: Floats, direction: Floats, inverse: Floats, free: Floats, side: int, i: int, c: int
) -> tuple[float, float]:
    """Return the acceleration (x, z) of an end in column ``c``, links included."""
    k = i - 1 if i > 0 else work.shape[1] - 1
    here, behind = work[side, i, FORCED + c], work[side, k, FORCED + c]
    fx = here * direction[side, i, 0] - behind * direction[side, k, 0]
    fz = here * direction[side, i, 1] - behind * direction[side, k, 1]
    a = inverse[side, i]
    return free[side, i, c, 0] + a[0] * fx + a[1] * fz, free[side, i, c, 1] + a[1] * fx + a[2] * fz


@compiled
def settle_parts(
    work: Floats, direction: Floats, inverse: Floats, free: Floats, coupling: Floats,
    reaction: Floats, inertia: Floats,
) -> None:  # fmt: skip
    """Take the chain out of the moving parts' equations: complete their forces and inertias."""
    m, n, parts, _ = coupling.shape
    for side in range(m):
        for i in range(n):
            for c in range(parts):
                gx, gz = coupling[side, i, c, 0], coupling[side, i, c, 1]
                if gx == 0.0 and gz == 0.0:
                    continue
                ax, az = pulled(work, direction, inverse, free, side, i, 0)
                reaction[c] += gx * ax + gz * az
                for d in range(c, parts):
                    ax, az = pulled(work, direction, inverse, free, side, i, 1 + d)
                    inertia[c, d] -= gx * ax + gz * az


@compiled
def write_accelerations(
    out: Floats, work: Floats, direction: Floats, inverse: Floats, free: Floats
) -> None:
    """Write the ends' accelerations; those of the moving parts are in ``out`` already."""
    m, n, columns, _ = free.shape
    stride, base = 1 + 2 * m, columns - 1
    for side in range(m):
        for i in range(n):
            for c in range(1, columns):
                work[side, i, FORCED] += out[c - 1] * work[side, i, FORCED + c]
                free[side, i, 0, 0] += out[c - 1] * free[side, i, c, 0]
                free[side, i, 0, 1] += out[c - 1] * free[side, i, c, 1]
    for side in range(m):
        for i in range(n):
            j = base + i * stride + 1 + 2 * side
            out[j], out[j + 1] = pulled(work, direction, inverse, free, side, i, 0)


@compiled
def correct_tension(
    tension: Floats, direction: Floats, damping: Floats, out: Floats, h: float, base: int
) -> None:
    """Move the links' damper force from the mid-step velocity to the step itself."""
    m, n = tension.shape
    stride = 1 + 2 * m
    for side in range(m):
        for i in range(n):
            k = i + 1 if i + 1 < n else 0
            a, b = base + i * stride + 1 + 2 * side, base + k * stride + 1 + 2 * side
            rate = (out[b] - out[a]) * direction[side, i, 0]
            rate += (out[b + 1] - out[a + 1]) * direction[side, i, 1]
            tension[side, i] += 0.5 * h * damping[side, i] * rate
