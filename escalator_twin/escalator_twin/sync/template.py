"""One loop of the twin at constant speed, as periodic functions of travel."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np
from scipy.interpolate import CubicSpline

from escalator_twin.signals import Floats

SPACING_M = 0.02  # of the template grid; 2 Hz at the slowest level is a wave of 0.12 m


@dataclass(frozen=True)
class Templates:
    """Simulated channels along travel, at constant speed.

    Attributes
    ----------
    travel_m : (n,) float64
        Increasing, even, m.
    rate_hz : float
        Rate at which that speed passes the grid, for the filters that both sides share.
    columns : mapping of channel to (n,) float64
        SI.
    """

    travel_m: Floats
    rate_hz: float
    columns: Mapping[str, Floats]

    @classmethod
    def of_run(cls, speed_m_s: float, time_s: Floats, columns: Mapping[str, Floats]) -> Self:
        """Return the templates that a run at constant speed recorded on an even time grid."""
        return cls(speed_m_s * time_s, 1.0 / float(time_s[1] - time_s[0]), columns)


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

    def tiled(self, start_m: float, end_m: float, speed_m_s: float) -> Templates:
        """Return the channels from about ``start_m`` to about ``end_m``, passed at a speed."""
        first = int(np.floor(start_m / self.spacing_m)) - 2
        last = int(np.ceil(end_m / self.spacing_m)) + 2
        index = np.arange(first, last + 1)
        rows = self.values[index % len(self.values)]
        columns = {c: rows[:, i] for i, c in enumerate(self.channels)}
        travel: Floats = np.multiply(index, self.spacing_m, dtype=np.float64)
        return Templates(travel, speed_m_s / self.spacing_m, columns)

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
