"""Shapes of the guide's curves: circular, or compensated so that the chain runs without ripple.

A link is a chord. Let a roller pass the place P(t), and the next one, one pitch L ahead, the place
P(t + T); then P(t + T) - P(t) = L e(theta(t)), e the unit vector of the link's angle. With P' =
v e(0) on the straight before the curve, v = L / T, and n links taken together

    P'(t + n T) = v e(0) + L d/dt sum_k e(theta(t + k T)).

The chain leaves at constant speed, and a carriage that closes it stands still, where that is
v e(turn) at every phase t: the sum of the unit vectors of the links at the curve grows linearly,

    sum_k e(theta(t + k T)) = S + (e(turn) - e(0)) t / T,    0 <= t < T.

No circle does that. Of all angles theta(t) from 0 to the turn that do, the one with the least
third derivative is taken, so that the curvature grows from zero and back.

This is the kinematics of rigid links without clearance; what is left in an elastic machine comes
from the stretch of links, contacts and the axles' inertia.
"""

from functools import lru_cache
from math import ceil, cos, pi, sin, tan

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from escalator_twin.errors import MachineError
from escalator_twin.signals import Floats

PHASES = 32  # per pitch, at which the condition is met
EASING = 5  # phases, by which a transition is longer than its circle, to be smooth
ITERATIONS = 40
CLOSED = 1e-12  # of a pitch: the condition is met
SETTLED = 1e-6  # rad: the smoothest is found
PER_NODE = 2  # phases between two nodes of the arcs, 25 mm on the prototype

# A curve is a row of arcs, (length m, turning rad) each, all to the same side.
Curve = tuple[tuple[float, float], ...]


def circular(turn: float, radius_m: float) -> Curve:
    """Return the arc of a circle."""
    return ((radius_m * turn, turn),)


def end_of(curve: Curve) -> tuple[float, float]:
    """Return where a curve ends that starts at the origin along x and turns to the left, m."""
    x, z, angle = 0.0, 0.0, 0.0
    for length, turn in curve:
        chord = length * float(np.sinc(turn / (2.0 * pi)))
        x += chord * cos(angle + turn / 2.0)
        z += chord * sin(angle + turn / 2.0)
        angle += turn
    return x, z


def tangent_length(curve: Curve) -> float:
    """Return the distance from a curve's ends to the corner of the straights that it joins, m."""
    x, z = end_of(curve)
    turn = sum(part[1] for part in curve)
    if turn == 0.0:
        return 0.5 * x
    return 0.5 * (x + z * (1.0 - cos(turn)) / sin(turn))


@lru_cache(maxsize=16)
def compensated(turn: float, radius_m: float, pitch_m: float) -> Curve:
    """Return the curve of about a radius on which links of one pitch run evenly.

    Parameters
    ----------
    turn : float
        Angle between the straights, rad; pi for a turnaround, whose runs are then exactly two
        radii apart.
    radius_m : float
        Of the circle in whose place the curve stands.
    pitch_m : float
        Length of the links that it is made for.

    Raises
    ------
    MachineError
        Where no such curve is found.
    """
    theta = link_angles(turn, radius_m, pitch_m)
    steps = np.exp(1j * theta)
    places = np.arange(len(theta) + PHASES, dtype=np.complex128) / PHASES
    for j in range(len(theta)):
        places[j + PHASES] = places[j] + steps[j]
    nodes = pitch_m * (places[PHASES : len(theta)] - 1.0)
    return _arcs(nodes, turn)


def link_angles(turn: float, radius_m: float, pitch_m: float) -> Floats:
    """Return theta at ``PHASES`` steps per pitch, from its last 0 to its first full turn.

    The curve takes the circle's place: on average, a chain closes where it did.
    """
    radius = radius_m / pitch_m
    spare = spare_way(turn, radius)
    if turn == pi:  # between parallel runs, the steps decide where the chain closes
        steps = round(PHASES * (1.0 - spare))
    else:
        steps = round((1.0 + radius * turn) * PHASES) + EASING
    theta = _smoothest(turn, radius, max(steps, 2 * PHASES + EASING), spare)
    if theta is None:
        raise MachineError(
            f'guide: no compensated curve of {np.rad2deg(turn):.1f} deg and about {radius_m} m '
            f'for links of {pitch_m} m'
        )
    return theta


def spare_way(turn: float, radius: float) -> float:
    """Return by how much the straights' part exceeds the links' length at a circle, in pitches.

    The way from a roller before the curve to one behind it is measured along the straights, to
    their corner, or to the plane of the curve's ends where they are parallel; the mean over a
    pitch of that way, less the number of links between the rollers, is returned.
    """

    def place(s: Floats) -> NDArray[np.complex128]:
        angle = np.clip(s, 0.0, radius * turn) / radius
        on_arc = 1j * radius * (1.0 - np.exp(1j * angle))
        return on_arc + np.minimum(s, 0.0) + np.maximum(s - radius * turn, 0.0) * np.exp(1j * turn)

    s = -1.0 - np.arange(PHASES) / PHASES
    before, links = -s, 0
    while s.min() < radius * turn + 1.0:
        low, high = s + 1.0, s + 2.0
        for _ in range(50):
            middle = 0.5 * (low + high)
            far = np.abs(place(middle) - place(s)) > 1.0
            low, high = np.where(far, low, middle), np.where(far, middle, high)
        s, links = 0.5 * (low + high), links + 1
    corner = 0.0 if turn == pi else 2.0 * radius * tan(turn / 2.0)
    return float(np.mean(before + s - radius * turn)) + corner - links


def _smoothest(turn: float, radius: float, steps: int, spare: float) -> Floats | None:
    """Return the smoothest theta of so many steps, or nothing where the method fails.

    The least sum of squared third differences under the condition at every phase, by Newton's
    method.
    """
    links = ceil(steps / PHASES) + 1
    theta = np.full(links * PHASES + 6, turn)
    theta[:3] = 0.0
    theta[3 : 3 + steps] = turn * np.arange(steps) / steps
    free = slice(4, 3 + steps)
    third = np.diff(np.eye(len(theta)), 3, axis=0)
    rough = third[:, free].T @ third
    bend = np.zeros(steps - 1)
    for _ in range(ITERATIONS):
        miss, slope = _condition(theta[3:-3], turn, links, radius, spare)
        slope = slope[:, 1:steps]
        n, m = steps - 1, len(miss)
        system = np.zeros((n + m, n + m))
        system[:n, :n] = rough[:, free] + np.diag(bend)
        system[:n, n:], system[n:, :n] = slope.T, slope
        change = np.linalg.solve(system, -np.concatenate([rough @ theta, miss]))
        theta[free] += change[:n]
        inner = theta[3 : 4 + steps]
        inner[:] = 0.5 * (inner + turn - inner[::-1])
        bend = _bend(theta[3:-3], change[n:], links, turn)[1:steps]
        if np.abs(miss).max() < CLOSED and np.abs(change[:n]).max() < SETTLED:
            return theta[3 : 4 + steps]
    return None


def _condition(
    theta: Floats, turn: float, links: int, radius: float, spare: float
) -> tuple[Floats, Floats]:
    """Return by how much the conditions are missed, and the slopes with theta.

    At each phase the sum of unit vectors, real and imaginary; last its value S at the first one.
    """
    e = np.exp(1j * theta).reshape(links, PHASES)
    total = e.sum(axis=0)
    phase = np.arange(1, PHASES)
    miss = total[1:] - total[0] - (np.exp(1j * turn) - 1.0) * phase / PHASES
    slope = np.zeros((PHASES - 1, links, PHASES), np.complex128)
    slope[phase - 1, :, phase] = 1j * e[:, phase].T
    slope[:, :, 0] = -1j * e[:, 0]
    flat = slope.reshape(PHASES - 1, -1)
    misses, slopes = [miss.real, miss.imag], [flat.real, flat.imag]
    weight, value = _closing(turn, links, radius, spare)
    row = np.zeros((links, PHASES))
    row[:, 0] = (np.conj(weight) * 1j * e[:, 0]).real
    misses.append(np.array([(np.conj(weight) * total[0]).real - value]))
    slopes.append(row.reshape(1, -1))
    return np.concatenate(misses), np.concatenate(slopes)


def _closing(turn: float, links: int, radius: float, spare: float) -> tuple[complex, float]:
    """Return the condition on S as (weight, value): Re(conj(weight) S) is the value."""
    if turn == pi:  # the distance of the runs
        return 1j, 2.0 * radius
    # S = a + b e(turn), and a + b is the number of links and what they have to spare
    return 1.0 + 1j * (1.0 - cos(turn)) / sin(turn), links + spare


def _bend(theta: Floats, multipliers: Floats, links: int, turn: float) -> Floats:
    """Return the second derivatives of the conditions times their multipliers."""
    n = PHASES - 1
    weight = np.zeros(PHASES, np.complex128)
    weight[1:] = multipliers[:n] + 1j * multipliers[n : 2 * n]
    closing, _ = _closing(turn, links, 0.0, 0.0)
    weight[0] = closing * multipliers[2 * n] - weight[1:].sum()
    return -(np.conj(np.tile(weight, links)) * np.exp(1j * theta)).real


def _arcs(nodes: Floats, turn: float) -> Curve:
    """Join places of a curve by pairs of arcs that meet with one tangent (biarcs).

    The tangents are those of a cubic spline through the places that starts and ends along the
    straights.
    """
    way = np.arange(len(nodes), dtype=np.float64)
    slope = abs(nodes[1] - nodes[0])
    ends = ((1, slope), (1, slope * np.exp(1j * turn)))
    tangents = np.unwrap(np.angle(CubicSpline(way, nodes, bc_type=ends)(way, 1)))
    keep = np.unique(np.append(np.arange(0, len(nodes), PER_NODE), len(nodes) - 1))
    nodes, tangents = nodes[keep], tangents[keep]
    tangents[0], tangents[-1] = 0.0, turn
    parts: list[tuple[float, float]] = []
    for i in range(len(nodes) - 1):
        chord = nodes[i + 1] - nodes[i]
        parts += _biarc(abs(chord), np.angle(chord) - tangents[i], tangents[i + 1] - tangents[i])
    return tuple(parts)


def _biarc(chord: float, first: float, turn: float) -> list[tuple[float, float]]:
    """Return two arcs over a chord that lies at ``first`` from the start's tangent, rad.

    The arcs share the turn so that their joint's tangent mirrors the mean of the ends' in the
    chord; then each spans half of a symmetric chord pair to second order in the turn.
    """
    # joint tangent at angle m from the start's; chords of the arcs at m/2 and (m + turn)/2
    joint = 2.0 * first - 0.5 * turn
    a, b = 0.5 * joint - first, 0.5 * (joint + turn) - first
    # l1 cos a + l2 cos b = chord, l1 sin a + l2 sin b = 0
    split = np.array([[cos(a), cos(b)], [sin(a), sin(b)]])
    if abs(np.linalg.det(split)) < 1e-12:
        halves = np.array([0.5 * chord, 0.5 * chord])
    else:
        halves = np.linalg.solve(split, [chord, 0.0])
    bends = (joint, turn - joint)
    return [
        (float(half / np.sinc(bend / (2.0 * pi))), float(bend))
        for half, bend in zip(halves, bends, strict=True)
    ]
