"""The rigid polygon: links of fixed length inscribed in the guide's centre line."""

import numpy as np
from scipy.optimize import brentq

from escalator_twin.errors import MachineError
from escalator_twin.physics.compiled import allocating, compiled
from escalator_twin.physics.path import GuidePath, point_at
from escalator_twin.signals import Floats


@compiled
def next_place(
    segments: Floats, length: float, s: float, u: float, chord: float, sign: float
) -> float:
    """Return the coordinate, ahead (+1) or behind (-1) of ``s``, one chord away."""
    x, z, _, _ = point_at(segments, length, s, u)
    guess = s + sign * chord
    for _ in range(60):
        px, pz, tx, tz = point_at(segments, length, guess, u)
        dx, dz = px - x, pz - z
        distance = np.sqrt(dx * dx + dz * dz)
        slope = sign * (dx * tx + dz * tz) / distance
        change = (chord - distance) / max(slope, 0.2)
        guess += sign * change
        if abs(change) < 1e-14:
            break
    return guess


@allocating
def walk(
    segments: Floats, length: float, s: float, u: float, chords: Floats, sign: float
) -> Floats:
    """Return the coordinates reached from ``s`` by successive chords, unwrapped."""
    places = np.empty(len(chords) + 1)
    places[0] = s
    for i in range(len(chords)):
        places[i + 1] = next_place(segments, length, places[i], u, chords[i], sign)
    return places


def inscribe(path: GuidePath, chords: Floats, s: float) -> tuple[Floats, float]:
    """Inscribe a closed polygon with a corner at ``s``.

    Parameters
    ----------
    path : GuidePath
        The guide's centre line.
    chords : (n,) float64
        Link lengths, m, the first from the corner at ``s`` ahead.
    s : float
        Path coordinate of the first corner, m.

    Returns
    -------
    places : (n,) float64
        Path coordinates of the corners, unwrapped, on the path with the carriage displaced.
    carriage_m : float
        The displacement at which the polygon closes.

    Raises
    ------
    MachineError
        Where no displacement within a third of a pitch closes the polygon.
    """

    def excess(u: float) -> float:
        return float(walk(path.segments, path.length_m, s, u, chords, 1.0)[-1] - s - path.length_m)

    bound = float(chords.mean()) / 3.0
    if excess(-bound) * excess(bound) > 0.0:
        raise MachineError(
            f'chain: {len(chords)} links of {chords.mean():.4f} m do not close in a guide of '
            f'{path.length_m:.4f} m: with the carriage at rest the gap is {-excess(0.0):+.4f} m'
        )
    u = brentq(excess, -bound, bound, xtol=1e-12)
    return walk(path.segments, path.length_m, s, u, chords, 1.0)[:-1], float(u)
