"""Tension along the loop by hand: a rope with the chain's weight, drag and stretch.

Both sides together, at walking pace or slower, the drive cut out. Along the path, with the unit
tangent (tx, tz), curvature k (positive to the left), angle b between two links, pitch L, weight w of an axle with its load,
rolling resistance mu, viscous drag c and direction d:

    N = w tx - T b                              guide's normal force on an axle
    dT/ds = [w tz + d (mu |N| + c v)] / L

A rope does for a chain: links press their roller on an arc of radius R with T L / R, and although
the arc holds fewer rollers than its length has pitches, each runs as much faster, so that weight
and drag do the same work on every pitch that passes. Only at the ends of curves the links' angle
grows over two pitches, where N may pass through zero. The tension on both runs at the carriage
balances it,

    T(passenger) + T(return) = preload - stiffness u,

and u follows from the chain's length: the rigid polygon's mean place, the links' stretch, and the
rollers' way to the inside of the curves through clearance and contact,

    u = u_polygon + 1/2 [sum T / stiffness + int k y ds],   y = survey - sign(N) (clearance/2 + |N| / k_n).
"""

from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np

from escalator_twin.machine import Guide, Machine
from escalator_twin.physics import run
from escalator_twin.physics.parameters import make_parameters, Parameters
from escalator_twin.physics.path import ARC, build_path, KIND, LENGTH, point_at, RADIUS, TURN
from escalator_twin.signals import Experiment, Floats
from escalator_twin.verification.figure import Figure
from escalator_twin.verification.polygon_limit import polygon_motion
from escalator_twin.verification.trial import case, ideal, start

SPEED_M_S = 0.05
STEP_M = 0.005
ROUNDS = 6
WITHIN = 0.5  # %


@dataclass(frozen=True)
class Rope:
    """Tension by hand.

    Attributes
    ----------
    place_m : (n,) float64
        Path coordinate.
    tension_n : (n,) float64
        Of both sides; linear where the drive holds.
    carriage_m : float
        Displacement of the carriage.
    """

    place_m: Floats
    tension_n: Floats
    carriage_m: float


@dataclass(frozen=True)
class _Track:
    """The path on an even grid: tangent, curvature, and the links' angle at a roller."""

    s: Floats
    tx: Floats
    tz: Floats
    bend: Floats
    angle: Floats


@lru_cache(maxsize=4)
def _track(guide: Guide, pitch_m: float) -> _Track:
    path = build_path(guide)
    n = round(path.length_m / STEP_M)
    s = (np.arange(n) + 0.5) * path.length_m / n
    tangents = np.array([point_at(path.segments, path.length_m, at, 0.0)[2:] for at in s])
    ends = np.cumsum(path.segments[:, LENGTH])
    rows = path.segments[np.searchsorted(ends, s)]
    bend = np.zeros(n)
    arc = rows[:, KIND] == ARC
    bend[arc] = rows[arc, TURN] / rows[arc, RADIUS]
    # the angle between two links is the curvature's mean, weighed by a triangle of a pitch each way
    away = np.minimum(np.arange(n), n - np.arange(n)) * path.length_m / n
    triangle = np.maximum(1.0 - away / pitch_m, 0.0)
    smeared = np.fft.irfft(np.fft.rfft(bend) * np.fft.rfft(triangle / triangle.sum()), n)
    return _Track(s, tangents[:, 0], tangents[:, 1], bend, pitch_m * smeared)


def rope(machine: Machine, experiment: Experiment) -> Rope:
    """Return the tension along the loop of a machine by hand."""
    p = make_parameters(machine, experiment, planar=True)
    track, path = _track(machine.guide, machine.chain.pitch_m), build_path(machine.guide)
    rigid = float(polygon_motion(path, machine.chain.n_links, p.pitch_m).mean())
    weight = _weight(p, track.s)
    even = np.arange(p.survey.shape[1]) * path.length_m / p.survey.shape[1]
    survey = np.interp(track.s, even, p.survey[0, :, 0], period=path.length_m)
    u, tension = rigid, np.zeros_like(track.s)
    for _ in range(ROUNDS):
        tension = _balance(p, track, weight, p.preload - p.carriage_stiffness * u)
        stretch = (tension / p.link_stiffness.mean()).mean() * machine.chain.n_links
        normal = weight * track.tx - tension * track.angle
        beside = survey - np.sign(normal) * (
            p.half_clearance + np.abs(normal) / p.contact_stiffness
        )
        curves = float(np.sum(track.bend * beside)) * path.length_m / len(track.s)
        u = rigid + 0.5 * (stretch + curves)
    return Rope(track.s, tension, u)


def _weight(p: Parameters, s: Floats) -> Floats:
    """Return the weight of an axle with its half of the loads before and behind it, N."""
    share = np.zeros_like(s)
    for middle in (s - 0.5 * p.pitch_m, s + 0.5 * p.pitch_m):
        inside = np.minimum(middle - p.load_from, p.load_to - middle)
        share += 0.5 * np.clip(inside / p.load_ramp, 0.0, 1.0)
    return p.end_mass.sum(axis=0).mean() * p.gravity + p.load.sum(axis=0).mean() * share


def _balance(p: Parameters, track: _Track, weight: Floats, on_carriage: float) -> Floats:
    """Return the tension that the carriage's force demands; secants, it is nearly linear."""
    one, two = 0.4 * on_carriage, 0.5 * on_carriage
    miss = _integrate(p, track, weight, one)[1] - on_carriage
    for _ in range(4):
        tension, total = _integrate(p, track, weight, two)
        change = total - on_carriage - miss
        if change == 0.0:
            break
        one, two, miss = (
            two,
            two - (total - on_carriage) * (two - one) / change,
            total - on_carriage,
        )
    return tension


def _integrate(p: Parameters, track: _Track, weight: Floats, first: float) -> tuple[Floats, float]:
    """Integrate both ways from the middle of the lower turnaround, where the tension is ``first``.

    Returns the tension, and what both runs pull at the carriage.
    """
    n, step = len(track.s), track.s[1] - track.s[0]
    direction, viscous = np.sign(p.speed), p.viscous_drag * abs(p.speed)
    turnaround = int(np.flatnonzero(track.bend == 0.0)[-1]) + 1
    middle = (turnaround + n) // 2
    begin, end = (int(i) for i in np.searchsorted(track.s, (p.drive_start, p.drive_end)))
    per_pitch = step / p.pitch_m
    straight = (weight * track.tx).tolist()
    curved = track.angle.tolist()
    rise = ((weight * track.tz + direction * viscous) * per_pitch).tolist()
    drag = direction * p.rolling_resistance.mean() * per_pitch
    tension = [0.0] * n
    t = first
    for j in [*range(middle, n), *range(begin)]:
        t += rise[j] + drag * abs(straight[j] - t * curved[j])
        tension[j] = t
    t = first
    for j in range(middle - 1, end, -1):
        t -= rise[j] + drag * abs(straight[j] - t * curved[j])
        tension[j] = t
    found = np.array(tension)
    found[begin : end + 1] = np.linspace(found[begin - 1], found[end + 1], end + 1 - begin)
    return found, float(found[0] + found[turnaround - 1])


def simulated(machine: Machine, experiment: Experiment) -> tuple[Floats, Floats, float]:
    """Return where each link was (from, to) over one pitch and its mean force of both sides, N."""
    n, pitch = machine.chain.n_links, machine.chain.pitch_m
    trial = start(machine, experiment, 2.0)
    probes = [(run.PLACE, i, 0) for i in range(n)] + [(run.LINK_FORCE, i, 0) for i in range(n)]
    duration = pitch / experiment.set_speed_m_s
    table = trial.record(round(duration, 3), 1000.0, *probes, (run.CARRIAGE, 0, 0))
    ends = np.column_stack([table[0, :n], table[-1, :n]])
    return ends, 2.0 * table[:, n : 2 * n].mean(axis=0), float(table[:, -1].mean())


def straight_errors(machine: Machine, experiment: Experiment) -> tuple[Floats, float]:
    """Return the relative difference of link forces from the rope's, and the carriage's (m).

    Of the links that stayed on straights, clear of curves, of the drive and of the load's ends by
    a pitch.
    """
    by_hand, pitch = rope(machine, experiment), machine.chain.pitch_m
    length = build_path(machine.guide).length_m
    ends, force, carriage = simulated(machine, experiment)
    p = make_parameters(machine, experiment, planar=True)
    bend, s = _track(machine.guide, machine.chain.pitch_m).bend, by_hand.place_m
    errors = []
    for (a, b), measured in zip(ends, force, strict=True):
        low, high = min(a, b) % length, min(a, b) % length + abs(b - a) + pitch
        here = ((s >= low - pitch) & (s <= high + pitch)) | (s <= high + pitch - length)
        if np.any(bend[here] != 0.0) or (
            low - pitch < p.drive_end and high + pitch > p.drive_start
        ):
            continue
        middle = np.linspace(low + 0.5 * pitch, high - 0.5 * pitch, 101)
        expected = np.interp(middle, s, by_hand.tension_n).mean()
        errors.append(measured / expected - 1.0)
    return np.array(errors), carriage - by_hand.carriage_m


def figures(machine: Machine) -> list[Figure]:
    """Return the figures of this page."""
    subject, found, carriages = 'static tension by hand', [], []
    for guide, load, direction, preload in product(
        ('exact guide', 'as surveyed'), (0.0, 75.0), (1, -1), (3000.0, 6000.0)
    ):
        one = ideal(machine) if guide == 'exact guide' else machine
        errors, carriage = straight_errors(one, case(SPEED_M_S, direction, load, preload))
        at = f'{guide}, {load:g} kg, {"up" if direction > 0 else "down"}, {preload:g} N'
        most = 100 * float(np.abs(errors).max())
        found.append(Figure(subject, f'{at}: largest of {len(errors)} links', most, '%', WITHIN))
        carriages.append(abs(carriage))
    most = 1e3 * max(carriages)
    return [
        *found,
        Figure(subject, 'place of the carriage, largest difference of all', most, 'mm'),
    ]
