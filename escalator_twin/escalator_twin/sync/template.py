"""One loop of the twin at constant speed, as periodic functions of travel."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from escalator_twin.signals import Floats

SPACING_M = 0.02  # of the template grid; 2 Hz at the slowest level is a wave of 0.12 m


@dataclass(frozen=True)
class Template:
    """Simulated channels over one loop of travel.

    Attributes
    ----------
    loop_m : float
        Travel after which the machine is where it was: links times pitch.
    channels : tuple of str
    values : (n, k) float64
        On an even grid of travel from 0, one column a channel, SI.
    place_m : (n,) float64
        Path coordinate of axle 0, unwrapped.
    """

    loop_m: float
    channels: tuple[str, ...]
    values: Floats
    place_m: Floats

    @property
    def spacing_m(self) -> float:
        """Spacing of the grid, m."""
        return self.loop_m / len(self.values)

    def tiled(self, start_m: float, end_m: float) -> tuple[Floats, dict[str, Floats]]:
        """Return travel and channels from about ``start_m`` to about ``end_m``."""
        first = int(np.floor(start_m / self.spacing_m)) - 2
        last = int(np.ceil(end_m / self.spacing_m)) + 2
        index = np.arange(first, last + 1)
        rows = self.values[index % len(self.values)]
        return index * self.spacing_m, {c: rows[:, i] for i, c in enumerate(self.channels)}

    def place_at(self, travel_m: float, direction: int, length_m: float) -> float:
        """Return the path coordinate of axle 0 at a travel, m, within one loop."""
        way = np.append(self.place_m, self.place_m[0] + direction * length_m)
        grid = np.arange(len(way)) * self.spacing_m
        return float(np.interp(travel_m % self.loop_m, grid, way) % length_m)


def make_template(
    channels: tuple[str, ...], columns: Floats, place_m: Floats, travel_m: Floats, loop_m: float
) -> Template:
    """Resample a run of a little more than one loop onto an even grid of travel.

    Parameters
    ----------
    channels : tuple of str
    columns : (m, k) float64
    place_m, travel_m : (m,) float64
        Travel starts at 0 and must reach ``loop_m``.
    loop_m : float
    """
    n = round(loop_m / SPACING_M)
    grid = np.arange(n) * (loop_m / n)
    values = CubicSpline(travel_m, columns)(grid)
    return Template(loop_m, channels, values, np.interp(grid, travel_m, place_m))
