"""The as-built deviation of the guide's channel centre, as a smooth periodic table."""

import csv
from functools import lru_cache
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize

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


def periodic_table(s: Floats, values: Floats, length_m: float, error_m: float = 0.0) -> Floats:
    """Interpolate a survey column on an even grid round the loop.

    A periodic cubic spline through the surveyed points, after the error of the survey has been
    weighed against the rail's own waves; a last point nearer to the seam than half the usual
    spacing is left out, since its error would make a kink there.

    Parameters
    ----------
    s, values : (n,) float64
        Surveyed points, m.
    length_m : float
        Of the loop.
    error_m : float
        One standard deviation of a point's error, m; 0 takes the points as exact.

    Returns
    -------
    table : (n, 2) float64
        Value (m) and slope (m/m) at ``i * length_m / n``.
    """
    spacing = float(np.median(np.diff(s)))
    keep = s < s[0] + length_m - 0.5 * spacing
    knots = np.append(s[keep], s[0] + length_m)
    column = values[keep]
    if error_m > 0.0:
        column = np.array(_without_error(tuple(column), error_m))
    spline = CubicSpline(knots, np.append(column, column[0]), bc_type='periodic')
    grid = np.arange(round(length_m / STEP_M)) * (length_m / round(length_m / STEP_M))
    return np.column_stack([spline(grid), spline(grid, 1)])


@lru_cache(maxsize=8)  # a landing's tolerance moves the loop's length, not the points
def _without_error(values: tuple[float, ...], error_m: float) -> tuple[float, ...]:
    return tuple(without_error(np.array(values), error_m))


def without_error(values: Floats, error_m: float) -> Floats:
    """Return surveyed values with white error taken out as far as their spectrum tells it.

    Wiener's filter: each wave is multiplied by P / (P + N), N the power of the survey's error,
    P that of the rail, taken as a power law of the wave number and fitted to the periodogram by
    Whittle's likelihood.

    Parameters
    ----------
    values : (n,) float64
        Evenly spaced round the loop, m.
    error_m : float
        One standard deviation of a point's error, m.
    """
    n = len(values)
    waves = np.fft.rfft(values - values.mean())
    level, slope = spectrum_of(values, error_m)
    rail = np.exp(level - slope * np.log(np.arange(1, len(waves))))
    waves[1:] *= rail / (rail + error_m**2)
    return np.fft.irfft(waves, n) + values.mean()


def spectrum_of(values: Floats, error_m: float) -> tuple[float, float]:
    """Return the power law of a surveyed rail, its white error apart.

    Parameters
    ----------
    values : (n,) float64
        Evenly spaced round the loop, m.
    error_m : float
        One standard deviation of a point's error, m.

    Returns
    -------
    level, slope : float
        Power (|coefficient|^2 / n of the discrete transform, m^2) of wave number k round the loop
        is exp(level - slope log k).
    """
    waves = np.fft.rfft(values - values.mean())
    number = np.arange(1, len(waves))
    power = np.abs(waves[1:]) ** 2 / len(values)
    noise = error_m**2

    def cost(law: Floats) -> float:
        total = np.exp(law[0] - law[1] * np.log(number)) + noise
        return float(np.sum(np.log(total) + power / total))

    start = [np.log(max(float(power[:3].mean()), noise, 1e-18)), 2.0]
    fitted = minimize(cost, start, method='Nelder-Mead')
    return float(fitted.x[0]), float(fitted.x[1])
