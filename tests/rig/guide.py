"""The guide as a chain of straights and arcs, and the survey laid along it.

The rig describes every axle end by its path coordinate ``s`` (m, along the roller-centre
path) and its offset ``n`` (m, to the left of travel in +s).  Each segment has one curvature,
so the equations of motion in these coordinates are exact inside a segment, and the velocity
components along tangent and normal are continuous across the joints.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from rig.sheet import Sheet

FloatArray = NDArray[np.float64]

TABLE_STEP_M = 0.0025  # m, spacing of the deviation tables; a twentieth of the survey's
UPPER_TURNAROUND = 5  # index of the segment
LOWER_TURNAROUND = 11  # index of the segment; the carriage carries it


@dataclass(frozen=True)
class Path2d:
    """Segments of the closed roller-centre path.

    Attributes
    ----------
    start : (13,) m, path coordinate where each segment starts; the last is the loop's length.
    x, z : (12,) m, where each segment starts.
    heading : (12,) rad, direction of travel at the start.
    curvature : (12,) 1/m, positive to the left.
    design_start : (13,) m, the same joints on the path as designed.
    """

    start: FloatArray
    x: FloatArray
    z: FloatArray
    heading: FloatArray
    curvature: FloatArray
    design_start: FloatArray


def incline_length(sheet: Sheet) -> float:
    """Return the straight incline's length (m) that gives the sheet's rise."""
    radii = sheet.lower_transition_radius_m + sheet.upper_transition_radius_m
    rise = sheet.rise_m - radii * (1.0 - np.cos(sheet.inclination_rad))
    return float(rise / np.sin(sheet.inclination_rad))


def segment_lengths(sheet: Sheet, lower_m: float = 0.0, upper_m: float = 0.0) -> FloatArray:
    """Return the 12 lengths (m); ``lower_m`` and ``upper_m`` are added to the landings."""
    angle = sheet.inclination_rad
    run = [
        sheet.lower_landing_m + lower_m,
        sheet.lower_transition_radius_m * angle,
        incline_length(sheet),
        sheet.upper_transition_radius_m * angle,
        sheet.upper_landing_m + upper_m,
    ]
    turn = [np.pi * sheet.turnaround_radius_m]
    return np.array(run + turn + run[::-1] + turn)


def lay_path(sheet: Sheet, lower_m: float = 0.0, upper_m: float = 0.0) -> Path2d:
    """Lay the path with landings longer than designed by the given lengths (m)."""
    lengths = segment_lengths(sheet, lower_m, upper_m)
    lower = 1.0 / sheet.lower_transition_radius_m
    upper = 1.0 / sheet.upper_transition_radius_m
    turn = 1.0 / sheet.turnaround_radius_m
    curvature = np.array([0, lower, 0, -upper, 0, -turn, 0, upper, 0, -lower, 0, -turn])
    x, z, heading = np.zeros(12), np.zeros(12), np.zeros(12)
    x[0] = -lengths[0]
    for i in range(11):
        turned = heading[i] + curvature[i] * lengths[i]
        if curvature[i] == 0.0:
            x[i + 1] = x[i] + lengths[i] * np.cos(heading[i])
            z[i + 1] = z[i] + lengths[i] * np.sin(heading[i])
        else:
            x[i + 1] = x[i] + (np.sin(turned) - np.sin(heading[i])) / curvature[i]
            z[i + 1] = z[i] - (np.cos(turned) - np.cos(heading[i])) / curvature[i]
        heading[i + 1] = turned
    design = np.concatenate([[0.0], np.cumsum(segment_lengths(sheet))])
    start = np.concatenate([[0.0], np.cumsum(lengths)])
    return Path2d(start, x, z, heading, curvature, design)


def read_survey(path: Path) -> FloatArray:
    """Read the survey: (rows, 3), path coordinate, normal and lateral deviation (m)."""
    return np.loadtxt(path, delimiter=',', skiprows=1)


def tabulate(s: FloatArray, values: FloatArray, length_m: float, smooth: bool) -> FloatArray:
    """Interpolate a deviation around the loop onto the rig's table.

    Parameters
    ----------
    s, values : (rows,) m, along the path and the deviation there.
    length_m : the loop's length; the rows close over it.
    smooth : a periodic cubic spline instead of straight lines between the rows.

    Returns
    -------
    (cells,) m, at multiples of ``length_m / cells``, the last just before the seam.
    """
    cells = round(length_m / TABLE_STEP_M)
    grid = np.arange(cells) * (length_m / cells)
    closed_s = np.append(s, length_m)
    closed = np.append(values, values[0])
    if smooth:
        return CubicSpline(closed_s, closed, bc_type='periodic')(grid)
    return np.interp(grid, closed_s, closed)


def point(path: Path2d, s: float) -> tuple[float, float]:
    """Return x and z (m) of the path at ``s`` (m) in 0 .. loop."""
    k = min(int(np.searchsorted(path.start, s, side='right')) - 1, 11)
    along, bend, heading = s - path.start[k], path.curvature[k], path.heading[k]
    if bend == 0.0:
        return path.x[k] + along * np.cos(heading), path.z[k] + along * np.sin(heading)
    turned = heading + bend * along
    return (
        path.x[k] + (np.sin(turned) - np.sin(heading)) / bend,
        path.z[k] - (np.cos(turned) - np.cos(heading)) / bend,
    )
