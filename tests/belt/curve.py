"""The closed curves of the guides, tabulated from their curvature."""

from dataclasses import dataclass
from math import cos, pi, radians, sin

import numpy as np
from scipy.optimize import brentq

GRID_M = 1e-3


@dataclass(frozen=True)
class Curve:
    """A closed curve: heading over way, and where it is; ends of its pieces."""

    length: float
    x: np.ndarray
    z: np.ndarray
    heading: np.ndarray
    bend: np.ndarray
    ends: tuple[float, ...]


def trace(pieces, start):
    """Return end point of (length, turn) pieces from (x, z, heading)."""
    x, z, a = start
    for length, turn in pieces:
        if abs(turn) < 1e-12:
            x, z = x + length * cos(a), z + length * sin(a)
        else:
            r = length / turn
            x, z = x + r * (sin(a + turn) - sin(a)), z - r * (cos(a + turn) - cos(a))
        a += turn
    return x, z, a


def tabulate(pieces, start):
    """Return the curve of pieces, exact at every grid point."""
    total = sum(length for length, _ in pieces)
    n = round(total / GRID_M)
    grid = np.arange(n + 1) * total / n
    x, z, heading, bend = np.empty((4, n + 1))
    here, state, ends = 0.0, start, [0.0]
    for length, turn in pieces:
        inside = (grid >= here - 1e-12) & (grid <= here + length + 1e-9)
        for i in np.flatnonzero(inside):
            part = (grid[i] - here) / length if length > 0.0 else 0.0
            x[i], z[i], heading[i] = trace([(length * part, turn * part)], state)
            bend[i] = turn / length if length > 0.0 else 0.0
        state = trace([(length, turn)], state)
        here += length
        ends.append(here)
    return Curve(total, x, z, heading, bend, tuple(ends))


def step_curves(sheet):
    """Return the curves of chain rollers and trailing rollers."""
    g, r = sheet['guide'], sheet['guide']['turnaround_radius_m']
    slope, back = radians(g['inclination_deg']), sheet['step']['wheelbase_m']
    lower, upper = g['lower_transition_radius_m'], g['upper_transition_radius_m']
    rise = g['rise_m'] - (lower + upper) * (1.0 - cos(slope))
    incline = rise / sin(slope)
    bend = g['return_transition_radius_m']

    def pieces(shift, fall, straight):
        return [
            (g['lower_landing_m'] - shift, 0.0), (lower * slope, slope), (incline, 0.0),
            (upper * slope, -slope), (g['upper_landing_m'] + shift, 0.0),
            (r * (pi - fall), -(pi - fall)), (straight, 0.0), (bend * fall, -fall),
            (r * pi, -pi),
        ]  # fmt: skip

    start = (0.0, r, 0.0)

    def gap(fall):
        x, z, _ = trace(pieces(0.0, fall, 0.0), start)
        return x * sin(fall) - (z - r) * cos(fall)

    fall = brentq(gap, 0.05, 1.0, xtol=1e-14)
    x, z, _ = trace(pieces(0.0, fall, 0.0), start)
    straight = float(np.hypot(x, z - r))
    return tuple(tabulate(pieces(shift, fall, straight), start) for shift in (0.0, back))


def handrail_curve(sheet):
    """Return the handrail's curve and its driven piece."""
    h, rise = sheet['handrail'], sheet['guide']['rise_m']
    g, slope = h['guide'], radians(sheet['guide']['inclination_deg'])
    lower, upper = g['lower_transition_radius_m'], g['upper_transition_radius_m']
    incline = (rise - (lower + upper) * (1.0 - cos(slope))) / sin(slope)
    steep, wrap, newel = (
        radians(g['steeper_deg']),
        radians(g['pulley_wrap_deg']),
        g['newel_radius_m'],
    )

    def pieces(fall, back):
        return [
            (g['lower_landing_m'], 0.0), (lower * slope, slope), (incline, 0.0),
            (upper * slope, -slope), (g['upper_landing_m'], 0.0), (newel * pi, -pi),
            (g['deflector_radius_m'] * (fall + steep), fall + steep),
            (h['pulley_radius_m'] * wrap, -wrap),
            (g['belt_tensioner_radius_m'] * (wrap - steep), wrap - steep), (back, 0.0),
            (g['lower_tensioner_radius_m'] * fall, -fall), (newel * pi, -pi),
        ]  # fmt: skip

    start = (0.0, 2.0 * newel, 0.0)

    def gap(fall):
        x, z, _ = trace(pieces(fall, 0.0), start)
        return x * sin(fall) - (z - 2.0 * newel) * cos(fall)

    fall = brentq(gap, 0.05, 1.0, xtol=1e-14)
    x, z, _ = trace(pieces(fall, 0.0), start)
    return tabulate(pieces(fall, float(np.hypot(x, z - 2.0 * newel))), start)
