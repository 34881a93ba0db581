"""Start the machine at a loop position and run it."""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from rig.guide import lay_path, LOWER_TURNAROUND, Path2d, point
from rig.integrate import march
from rig.layout import CARRIED, DOG, MARK_ROWS, NO_DOG, RACK, TAIL, U
from rig.model import Model
from rig.sheet import chosen

STEP_S = 1e-3 / 3.0  # s; against 1.25e-4 s the link forces differ by 0.3 N rms
ROW_S = 1e-3  # s, between two rows of RECORD
EVERY = 3  # steps per row
LARGEST_U_M = 0.06  # m, bracket of the carriage's displacement at which the chain closes


def lay_chain(path: Path2d, s0: float, links: int, pitch_m: float) -> NDArray[np.float64]:
    """Lay unloaded links from ``s0`` (m) along the path; return (links + 1,) coordinates."""
    s = np.empty(links + 1)
    s[0] = s0
    loop = path.start[-1]
    for i in range(links):
        here = point(path, s[i] % loop)

        def excess(after: float, here: tuple[float, float] = here) -> float:
            there = point(path, after % loop)
            return np.hypot(there[0] - here[0], there[1] - here[1]) - pitch_m

        s[i + 1] = brentq(excess, s[i] + 0.9 * pitch_m, s[i] + 1.2 * pitch_m, xtol=1e-9)
    return s


def stretched(model: Model, u: float) -> Path2d:
    """Return the model's path with the carriage ``u`` (m) further out."""
    sheet = chosen()
    lengths = np.diff(model.seg_start)
    return lay_path(
        sheet,
        float(lengths[0]) - sheet.lower_landing_m + u,
        float(lengths[4]) - sheet.upper_landing_m,
    )


def wrapped(value: float, length: float) -> float:
    """Return ``value`` modulo ``length``, nearest to zero."""
    return (value + 0.5 * length) % length - 0.5 * length


def closed_chain(model: Model, s0: float) -> tuple[NDArray[np.float64], float, NDArray]:
    """Return the axles' path coordinates (m), the carriage's u (m) and who is on it."""
    half = model.mass.size // 2
    pitch = float(np.mean(model.rest))

    def gap(u: float) -> float:
        path = stretched(model, u)
        s = lay_chain(path, s0 % model.loop, half, pitch)
        return s[-1] - s[0] - path.start[-1]

    u = brentq(gap, -LARGEST_U_M, LARGEST_U_M, xtol=1e-7)
    path = stretched(model, u)
    laid = lay_chain(path, s0 % model.loop, half, pitch)[:-1] % path.start[-1]
    carried = laid > path.start[LOWER_TURNAROUND]
    return laid - np.where(carried, 2.0 * u, u), u, carried


def start_state(model: Model, rack: float) -> tuple[NDArray, NDArray, NDArray]:
    """Lay the unloaded chain so that axle i meets dog i of a rack that has moved ``rack`` (m).

    Dog i stands at ``rack + i * pitch``; axle 0 is then within some centimetres of
    ``rack`` modulo the loop.  All axles move at the mean speed.
    """
    ends = model.mass.size
    half = ends // 2
    middle = 0.5 * (model.drive_from + model.drive_to)
    s0 = rack
    for _ in range(3):
        s, u, carried = closed_chain(model, s0)
        held = int(np.argmin(np.abs(s - middle)))
        s0 += wrapped(rack + held * model.pitch - s[held], half * model.pitch)
    y = np.zeros(5 * ends + TAIL)
    y[:ends] = np.tile(s, 2)
    y[2 * ends : 3 * ends] = model.direction * model.speed
    y[5 * ends + U], y[5 * ends + RACK] = u, rack
    marks = np.zeros((MARK_ROWS, ends), np.int64)
    marks[DOG] = NO_DOG
    marks[CARRIED] = np.tile(carried, 2)
    return y, marks, np.zeros(ends)


def ripple_travel(model: Model, rack: float, t: float) -> float:
    """Return how far ripple and hunting have moved the rack from its mean travel (m)."""
    travel = 0.0
    if model.ripple != 0.0:
        wave = 2.0 * np.pi * model.ripple_per_m
        travel -= model.ripple / wave * np.cos(wave * rack + model.ripple_phase)
    if model.hunting != 0.0:
        omega = 2.0 * np.pi * model.hunting_hz
        lag = np.cos(omega * t + model.hunting_phase)
        travel -= model.direction * model.speed * model.hunting / omega * lag
    return float(travel)


def run(
    model: Model,
    rack: float,
    settle_s: float,
    duration_s: float,
    every: int = EVERY,
    step_s: float = STEP_S,
) -> NDArray[np.float64]:
    """Settle, then record every ``every`` steps for ``duration_s``.

    The rack has then moved ``rack`` (m), speed ripples apart; while settling it has the
    speed of time 0.
    """
    speed = model.direction * model.speed * (1.0 + model.wander[0])
    first = rack - speed * settle_s
    y, marks, slip = start_state(model, first + ripple_travel(model, first, -settle_s))
    n_settle = round(settle_s / step_s)
    march(model, y, marks, slip, -n_settle * step_s, step_s, n_settle, n_settle)
    n_steps = round(duration_s / step_s)
    rows = march(model, y, marks, slip, 0.0, step_s, n_steps, every)
    if not np.isfinite(rows).all():
        raise FloatingPointError('the machine left its guide: a state is no longer finite')
    return rows
