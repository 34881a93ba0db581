"""Start the machine at a loop position and run it."""

import numpy as np
from numpy.typing import NDArray

from rig.dynamics import MARK_ROWS, NO_DOG, DOG, RACK, CARRIED, SEGMENT
from rig.integrate import march
from rig.model import Model

STEP_S = 1e-3 / 3.0  # s; against 1.25e-4 s the link forces differ by 0.3 N rms
ROW_S = 1e-3  # s, between two rows of RECORD


def start_state(model: Model, s0: float) -> tuple[NDArray, NDArray, NDArray]:
    """Space the axles evenly round the loop, axle 0 at ``s0`` (m), all at the mean speed."""
    ends = model.mass.size
    half = ends // 2
    y = np.zeros(5 * ends + 5)
    s = (s0 + np.arange(half) * model.loop / half) % model.loop
    y[:ends] = np.tile(s, 2)
    y[2 * ends: 3 * ends] = model.direction * model.speed
    marks = np.zeros((MARK_ROWS, ends), np.int64)
    marks[DOG] = NO_DOG
    marks[CARRIED] = y[:ends] > model.seg_start[11]
    y[5 * ends + RACK] = s0
    return y, marks, np.zeros(ends)


def run(model: Model, s0: float, settle_s: float, duration_s: float, every: int = 3,
        step_s: float = STEP_S) -> NDArray[np.float64]:
    """Settle, then record every ``every`` steps for ``duration_s`` from axle 0 near ``s0``."""
    y, marks, slip = start_state(model, s0 - model.direction * model.speed * settle_s)
    n_settle = int(round(settle_s / step_s))
    march(model, y, marks, slip, -n_settle * step_s, step_s, n_settle, n_settle)
    n_steps = int(round(duration_s / step_s))
    return march(model, y, marks, slip, 0.0, step_s, n_steps, every)
