"""What the recordings tell of the drive's slow wander."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from rig.readings import base_of

FloatArray = NDArray[np.float64]

STEP_S = 0.25  # s, at which the fitted travel is read
EDGE_S = 3.0  # s, left out at both ends, where a spline is loose
PERIODS_S = np.geomspace(25.0, 250.0, 60)  # s, at which a fit begins


def one_wave(time_s: FloatArray, travel_m: FloatArray) -> tuple[float, float, float]:
    """Fit start, speed and one wave of the speed to travel.

    Returns
    -------
    amplitude, period, rest : float
        The wave's relative amplitude, its period (s), and the root mean square of what is left (m).
    """

    def columns(period: float) -> FloatArray:
        turn = 2.0 * np.pi * time_s / period
        return np.column_stack([np.ones(time_s.size), time_s, np.cos(turn), np.sin(turn)])

    def left(period: float) -> FloatArray:
        c = columns(period)
        return travel_m - c @ np.linalg.lstsq(c, travel_m, rcond=None)[0]

    start = min(PERIODS_S, key=lambda period: float(np.sum(left(period) ** 2)))
    period = float(least_squares(lambda p: 1e3 * left(float(p[0])), [start], x_scale=10.0).x[0])
    parts = np.linalg.lstsq(columns(period), travel_m, rcond=None)[0]
    speed = 2.0 * np.pi / period * float(np.hypot(parts[2], parts[3]))
    return speed / abs(parts[1]), period, float(np.std(left(period)))


def show_wander(bags: list[Path]) -> None:
    """Print, for each recording, how far travel is from an even speed's, and the wave in it."""
    print(
        'travel: root mean square off an even speed; one wave of the speed fitted to it; the rest'
    )
    for path in bags:
        measured, _, travel = base_of(path)
        time_s = np.arange(measured.onboard_s[0] + EDGE_S, measured.onboard_s[-1] - EDGE_S, STEP_S)
        way = travel.at(time_s)
        even = way - np.polyval(np.polyfit(time_s, way, 1), time_s)
        amplitude, period, rest = one_wave(time_s, way)
        print(
            f'  {path.name:26s} {1e3 * even.std():6.2f} mm '
            f'({1e3 * even.std() / abs(travel.velocity):5.1f} ms)   '
            f'{amplitude:.5f} of the speed, {period:5.1f} s   {1e3 * rest:.2f} mm',
            flush=True,
        )
