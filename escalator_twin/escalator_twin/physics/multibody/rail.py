"""The handrail as a network: bodies on their guides, two points each, and the driving pulley."""

from dataclasses import dataclass, replace
from math import asin, sqrt

import numpy as np
from scipy.optimize import brentq

from escalator_twin.machine.multibody import Handrail, MultibodyMachine
from escalator_twin.physics.compiled import compiled
from escalator_twin.physics.multibody.guide import handrail_track, SIDES, Track
from escalator_twin.physics.multibody.network import Network
from escalator_twin.physics.multibody.segments import place_on, ROTOR
from escalator_twin.signals import Experiment, Floats

POINT_SHARE = 0.25  # of a body's length: its two points lie so far from its middle


@dataclass(frozen=True)
class HandrailPart:
    """A network of a handrail with what is needed to place it.

    Attributes
    ----------
    network : Network
    track : Track
    spacing_m : float
        Between the middles of two bodies, along the centre line.
    rest : (n, 3) float64
        Coordinates of the bodies.
    """

    network: Network
    track: Track
    spacing_m: float
    rest: Floats


def pulley_speed(handrail: Handrail, spacing_m: float, speed_m_s: float) -> float:
    r"""Return the pulley's rad/s at which the handrail runs straight at ``speed_m_s``.

    Bodies with two points a distance 2 b apart on a circle of radius R have their middles on
    :math:`r = \sqrt{R^2 - b^2}`, and links of length L then stand at angles
    :math:`2 \arcsin(L / 2r)`: one passes in the time in which one link passes on the straight.
    """
    b = POINT_SHARE * spacing_m
    middle = sqrt(handrail.pulley_radius_m**2 - b**2)
    return 2.0 * asin(spacing_m / (2.0 * middle)) * speed_m_s / spacing_m


def handrail_part(
    machine: MultibodyMachine, handrail: Handrail, experiment: Experiment
) -> HandrailPart:
    """Lay out a machine's handrail, its speed in proportion to the steps'."""
    track = handrail_track(machine, handrail)
    n = handrail.n_bodies
    spacing = track.length_m / n
    each = np.arange(n)
    ratio = experiment.set_speed_m_s / machine.experiment.speed_m_s
    speed = experiment.direction * pulley_speed(handrail, spacing, handrail.speed_m_s * ratio)
    mass = handrail.mass_per_m_kg * spacing
    link = [
        handrail.axial_stiffness_n / spacing, SIDES * handrail.link_damping_n_s_m, spacing,
        handrail.bending_stiffness_n_m2 / spacing, handrail.bending_drag_n_m,
        handrail.bending_rate_rad_s,
    ]  # fmt: skip
    segments = track.rows.copy()
    segments[segments[:, ROTOR] >= 0.0, ROTOR] = 0.0
    offset = POINT_SHARE * spacing
    network = Network(
        mass=np.full(n, mass),
        inertia=np.full(n, mass * spacing**2 / 12.0),
        link_ends=np.stack([each, (each + 1) % n], axis=1),
        link=np.tile(link, (n, 1)),
        bush_ends=np.zeros((0, 2), np.int64),
        bush=np.zeros((0, 4)),
        point_body=np.repeat(each, 2),
        point_offset=np.tile([-offset, offset], n),
        point_rows=np.tile([[0, len(segments)]], (2 * n, 1)),
        point_partner=np.full(2 * n, -1),
        drag=np.zeros((2 * n, 8)),
        segments=segments,
        part=np.zeros((0, 10)),
        rotor=np.array([[speed, handrail.pulley_radius_m, 0.0, 0.0, 0.0]]),
        load=np.zeros(n),
        load_point=np.full(n, -1),
        load_stretch=np.zeros(3),
        stretch_drag=np.zeros((0, 5)),
        gravity=machine.gravity_m_s2,
    )
    rest, chord = place_handrail(track, n)
    part = HandrailPart(network, track, spacing, rest)
    return tightened(
        part, spacing - chord * (1.0 - handrail.tension_n / handrail.axial_stiffness_n)
    )


@compiled
def middle_at(rows: Floats, length: float, s: float, half: float) -> tuple[float, float, float]:
    """Return middle (x, z) and angle of a body whose two points are at ``s - half, s + half``."""
    ax, az, _, _ = place_on(rows, length, s - half)
    bx, bz, _, _ = place_on(rows, length, s + half)
    return 0.5 * (ax + bx), 0.5 * (az + bz), np.arctan2(bz - az, bx - ax)


@compiled
def string(rows: Floats, length: float, half: float, chord: float, q: Floats) -> float:
    """Place bodies with middles ``chord`` apart; return the way from the first round to it, m."""
    s, reach = 0.0, 1e-6
    for i in range(len(q)):
        q[i, 0], q[i, 1], q[i, 2] = middle_at(rows, length, s, half)
        ahead = s + chord
        for _ in range(30):
            x, z, _ = middle_at(rows, length, ahead, half)
            distance = np.sqrt((x - q[i, 0]) ** 2 + (z - q[i, 1]) ** 2)
            x, z, _ = middle_at(rows, length, ahead + reach, half)
            slope = (np.sqrt((x - q[i, 0]) ** 2 + (z - q[i, 1]) ** 2) - distance) / reach
            change = (chord - distance) / slope
            ahead += change
            if abs(change) < 1e-10:
                break
        s = ahead
    return s


def place_handrail(track: Track, n: int) -> tuple[Floats, float]:
    """Return coordinates of ``n`` bodies round the centre line, and how far apart they are."""
    q = np.zeros((n, 3))
    half = POINT_SHARE * track.length_m / n

    def open_by(chord: float) -> float:
        return float(string(track.rows, track.length_m, half, chord, q)) - track.length_m

    even = track.length_m / n
    chord = float(brentq(open_by, 0.98 * even, 1.001 * even, xtol=1e-10))
    open_by(chord)
    return q, chord


def tightened(part: HandrailPart, change_m: float) -> HandrailPart:
    """Return a part whose links are shorter by ``change_m`` each: what a tensioner takes up."""
    link = part.network.link.copy()
    link[:, 2] -= change_m
    return replace(part, network=part.network._replace(link=link))
