"""What the law looks up along the rails, as a cubic for every cell of a table."""

from typing import NamedTuple

import numpy as np

from escalator_twin.physics.compiled import compiled
from escalator_twin.physics.parameters import Parameters
from escalator_twin.signals import Floats


class Rails(NamedTuple):
    """Deviations of the guide along the path, m, as cubics in the share of a cell.

    An axle end reads four numbers that lie side by side, once for value and slope.
    """

    normal: Floats  # (m, n, 4)
    lateral: Floats  # (1, n, 4)


def make_rails(p: Parameters) -> Rails:
    """Return the rails of some parameters."""
    return Rails(cubics(p.survey, p.length_m), cubics(p.lateral, p.length_m))


def cubics(tables: Floats, length_m: float) -> Floats:
    """Return Hermite's cubics of periodic tables.

    Parameters
    ----------
    tables : (m, n, 2) float64
        Values and slopes (per m) at ``i * length_m / n``.
    length_m : float
        Of the loop.

    Returns
    -------
    cubics : (m, n, 4) float64
        Coefficients of 1, t, t^2, t^3; t runs from 0 to 1 over a cell.
    """
    here, slope = tables[..., 0], tables[..., 1] * (length_m / tables.shape[1])
    ahead, slope_ahead = np.roll(here, -1, axis=1), np.roll(slope, -1, axis=1)
    rise = ahead - here
    return np.stack(
        [here, slope, 3.0 * rise - 2.0 * slope - slope_ahead, slope + slope_ahead - 2.0 * rise],
        axis=2,
    )


@compiled
def rail_at(rails: Floats, row: int, position: float, per_m: float) -> tuple[float, float]:
    """Return value and slope (per m) of a rail.

    Parameters
    ----------
    rails : (m, n, 4) float64
        From ``cubics``.
    row : int
        Of the rails.
    position : float
        In cells.
    per_m : float
        Cells per metre.
    """
    n = rails.shape[1]
    low = int(np.floor(position))
    t = position - low
    i = low if 0 <= low < n else low % n
    a, b, c, d = rails[row, i, 0], rails[row, i, 1], rails[row, i, 2], rails[row, i, 3]
    return a + t * (b + t * (c + t * d)), (b + t * (2.0 * c + 3.0 * d * t)) * per_m
