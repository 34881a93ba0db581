"""March the machine with the classical Runge-Kutta scheme of fourth order, compiled."""

from collections.abc import Callable
from hashlib import sha256
import math
from pathlib import Path

from numba import njit
import numpy as np
from numpy.typing import NDArray

from rig.dynamics import rates
from rig.forcing import dog_offset
from rig.kernel import ERROR_MODEL, kernel
from rig.layout import (
    CARRIED,
    COS,
    DOG,
    FN,
    FT,
    LAPS,
    MODE,
    NO_DOG,
    NORMAL,
    PULL,
    RACK,
    S_DESIGN,
    SEGMENT,
    SIN,
    TENSION,
    U,
    U_RATE,
    WORK_ROWS,
    X,
    Z,
)
from rig.model import RECORD

FloatArray = NDArray[np.float64]
COLUMNS = len(RECORD)


@kernel
def hand_over(model, y, marks):
    """Pass axle ends between fixed rails and carriage, and round the seam."""
    ends = model.mass.size
    u = y[5 * ends + U]
    loop, turn = model.seg_start[12], model.seg_start[11]
    for e in range(ends):
        s = y[e]
        if marks[CARRIED, e] == 0:
            if s > turn + u:
                marks[CARRIED, e] = 1
                y[e] = s - u
            elif s < -u:
                marks[CARRIED, e] = 1
                marks[LAPS, e] -= 1
                y[e] = s + u + loop
        elif s > loop:
            marks[CARRIED, e] = 0
            marks[SEGMENT, e] = 0
            marks[LAPS, e] += 1
            y[e] = s - loop - u
        elif s < turn:
            marks[CARRIED, e] = 0
            marks[SEGMENT, e] = 10
            y[e] = s + u


@kernel
def engage(model, y, marks, slip, work):
    """Give each axle end that enters the drive its nearest dog; let overloaded dogs slip."""
    ends = model.mass.size
    rack = y[5 * ends + RACK]
    for e in range(ends):
        s = work[S_DESIGN, e]
        if s <= model.drive_from or s >= model.drive_to:
            marks[DOG, e] = NO_DOG
            slip[e] = 0.0
            continue
        if marks[DOG, e] == NO_DOG:
            marks[DOG, e] = round((s - rack) / model.pitch)
        dog = marks[DOG, e]
        stretch = rack + dog * model.pitch + slip[e] + dog_offset(model, dog) - s
        most = model.slip_force / model.drive_k
        if abs(stretch) > most:
            slip[e] -= stretch - math.copysign(most, stretch)


@kernel
def record(model, y, work, dy, row):
    """Write one row of ``RECORD`` from the state and its accelerations."""
    ends = model.mass.size
    half = ends // 2
    tail = 5 * ends
    row[0], row[1], row[2] = y[tail + RACK], y[tail + U], y[tail + U_RATE]
    row[3], row[4] = work[TENSION, 0], work[TENSION, half // 2]
    row[5], row[6] = work[TENSION, half], work[TENSION, half + half // 2]
    ax = az = dx = dz = 0.0
    for e in (0, 1, half, half + 1):
        at, an = work[FT, e], work[FN, e]
        ax += 0.25 * (at * work[COS, e] - an * work[SIN, e])
        az += 0.25 * (at * work[SIN, e] + an * work[COS, e])
    for e in (0, half):
        dx += 0.5 * (work[X, e + 1] - work[X, e])
        dz += 0.5 * (work[Z, e + 1] - work[Z, e])
    row[7], row[9] = ax, az
    row[8] = 0.5 * (dy[4 * ends + half] + dy[4 * ends + half + 1])
    row[10] = math.atan2(dz, dx)
    for a in range(2):
        row[11 + a] = work[S_DESIGN, a * half]
        row[15 + 4 * a] = work[NORMAL, a * half]
        row[16 + 4 * a] = work[NORMAL, a * half + 1]
        row[17 + 4 * a] = work[NORMAL, a * half + half // 2]
        row[18 + 4 * a] = work[NORMAL, a * half + half // 2 + 1]
    row[13] = y[tail + MODE]
    row[23] = 0.0
    for e in range(ends):
        row[23] = max(row[23], abs(work[PULL, e]))
    roll = work[Z, 0] + work[Z, 1] - work[Z, half] - work[Z, half + 1]
    row[14] = 0.5 * roll


def compiled_march(source: str) -> Callable[..., FloatArray]:
    """Return the compiled time loop; ``source`` is part of its key in numba's cache.

    Only this function is cached, with all that it calls.  Numba looks at its file only:
    without the key, a change of another file would leave the old machine in the cache.
    """

    @njit(cache=True, error_model=ERROR_MODEL)
    def march(model, y, marks, slip, t0, step, n_steps, every):
        """Integrate ``n_steps`` steps in place; return a row of ``RECORD`` every ``every``."""
        work = np.zeros((WORK_ROWS + len(source) * 0, model.mass.size))
        k1, k2, k3, k4 = np.zeros_like(y), np.zeros_like(y), np.zeros_like(y), np.zeros_like(y)
        at = np.zeros_like(y)
        rows = np.zeros((n_steps // every, COLUMNS))
        for i in range(n_steps):
            t = t0 + i * step
            rates(model, t, y, marks, slip, work, k1)
            engage(model, y, marks, slip, work)
            if i % every == 0 and i // every < rows.shape[0]:
                record(model, y, work, k1, rows[i // every])
            for j in range(y.size):
                at[j] = y[j] + 0.5 * step * k1[j]
            rates(model, t + 0.5 * step, at, marks, slip, work, k2)
            for j in range(y.size):
                at[j] = y[j] + 0.5 * step * k2[j]
            rates(model, t + 0.5 * step, at, marks, slip, work, k3)
            for j in range(y.size):
                at[j] = y[j] + step * k3[j]
            rates(model, t + step, at, marks, slip, work, k4)
            for j in range(y.size):
                y[j] += step / 6.0 * (k1[j] + 2.0 * (k2[j] + k3[j]) + k4[j])
            hand_over(model, y, marks)
        return rows

    return march


SOURCES = (
    'dynamics.py',
    'forcing.py',
    'integrate.py',
    'kernel.py',
    'layout.py',
    'model.py',
)
march = compiled_march(
    ''.join(sha256(Path(__file__).with_name(name).read_bytes()).hexdigest() for name in SOURCES)
)
