"""Change one side's numbers, also where both sides are lumped into one row.

A planar model has one row for both sides. Forces, drags and weights of the sides add there;
lengths and heights enter by half, since the row stands for the mean of both. What a planar
model can say of a one-sided cause is its symmetric part.
"""

import numpy as np

from escalator_twin.causes.places import BOTH
from escalator_twin.physics.parameters import SIDES
from escalator_twin.signals import Floats

Where = int | slice


def rows_of(side: str, n_rows: int) -> tuple[int, ...]:
    """Return the row of each end that ``side`` names: one entry an end."""
    sides = SIDES if side == BOTH else (side,)
    return tuple(min(SIDES.index(name), n_rows - 1) for name in sides)


def add_sum(values: Floats, side: str, where: Where, amount: float) -> Floats:
    """Return ``values`` (rows, ...) with a force, mass or weight added per named end."""
    return _added(values, side, where, amount)


def add_mean(values: Floats, side: str, where: Where, amount: float | Floats) -> Floats:
    """Return ``values`` (rows, ...) with a length added per named end."""
    return _added(values, side, where, np.multiply(amount, len(values) / len(SIDES)))


def _added(values: Floats, side: str, where: Where, amount: float | Floats) -> Floats:
    changed = values.copy()
    for row in rows_of(side, len(values)):
        changed[row, where] += amount
    return changed


def add_phasor(values: Floats, side: str, where: Where, amplitude: float, phase: float) -> Floats:
    """Return pairs of amplitude and phase (rows, n, 2) with a wave added at one place."""
    changed = values.copy()
    share = len(values) / len(SIDES)
    for row in rows_of(side, len(values)):
        size, angle = changed[row, where]
        total = size * np.exp(1j * angle) + share * amplitude * np.exp(1j * phase)
        changed[row, where] = abs(total), np.angle(total)
    return changed


def with_slip(values: Floats, side: str, axle: int, slip: float) -> Floats:
    """Return the rollers' slips (rows, n) with one of them changed."""
    if slip == 0.0:
        return values
    changed = values.copy()
    for row in rows_of(side, len(values)):
        changed[row, axle] = slip
    return changed
