"""The as-built deviation of the guide's channel centre, as a smooth periodic table."""

import csv
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from escalator_twin.errors import MachineError
from escalator_twin.signals import Floats

STEP_M = 0.005  # table spacing; a cubic between knots 50 mm apart is resolved to 1e-7 m


def read_survey(path: Path) -> tuple[Floats, Floats, Floats]:
    """Read columns ``s, normal, lateral`` (m) of a survey file.

    Raises
    ------
    MachineError
        Where the file is missing, a column is missing or a row is not numeric or not ordered.
    """
    try:
        with path.open(newline='', encoding='utf-8') as file:
            rows = list(csv.DictReader(file))
        table = np.array([[float(row[key]) for key in ('s', 'normal', 'lateral')] for row in rows])
    except OSError as error:
        raise MachineError(f'guide.survey_file: {path}: {error.strerror}') from error
    except (KeyError, TypeError, ValueError) as error:
        raise MachineError(
            f'guide.survey_file: {path}: expected numeric columns s, normal, lateral; '
            f'found {error}'
        ) from error
    if len(table) < 4 or not np.all(np.diff(table[:, 0]) > 0.0):
        raise MachineError(f'guide.survey_file: {path}: expected at least 4 rows, s increasing')
    return table[:, 0], table[:, 1], table[:, 2]


def periodic_table(s: Floats, values: Floats, length_m: float) -> Floats:
    """Interpolate a survey column on an even grid round the loop.

    A periodic cubic spline through the surveyed points; a last point nearer to the seam than
    half the usual spacing is left out, since its error would make a kink there.

    Returns
    -------
    table : (n, 2) float64
        Value (m) and slope (m/m) at ``i * length_m / n``.
    """
    spacing = float(np.median(np.diff(s)))
    keep = s < s[0] + length_m - 0.5 * spacing
    knots = np.append(s[keep], s[0] + length_m)
    column = np.append(values[keep], values[0])
    spline = CubicSpline(knots, column, bc_type='periodic')
    grid = np.arange(round(length_m / STEP_M)) * (length_m / round(length_m / STEP_M))
    return np.column_stack([spline(grid), spline(grid, 1)])
