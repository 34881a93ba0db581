"""Speed of a roller that leaves a wheel, against eqs. (1) and (2) of Cano-Moreno et al.

The wheel turns at constant angular speed w; roller 1 sits on it at the angle alpha, roller 2, one
pitch L ahead, has left it and runs on a straight rail along the tangent at the top. Then

    x2 = -R cos(alpha) + sqrt(L^2 - (R - R sin(alpha))^2)                                (1)
    v2 = w [R sin(alpha) + R cos(alpha) / sqrt((L / (R (1 - sin(alpha))))^2 - 1)]        (2)

for alpha from pi/2 - 2 arcsin(L / 2R), where roller 2 leaves, to pi/2, where roller 1 does.
"""

from math import asin, pi

import numpy as np

from escalator_twin.machine import Machine
from escalator_twin.physics import run
from escalator_twin.signals import Floats
from escalator_twin.verification.figure import Figure
from escalator_twin.verification.plot import Line, svg
from escalator_twin.verification.trial import case, ideal, start

SPEED_M_S = 0.5
STIFF = 30.0
BEFORE_PITCHES = 1.5
RATE_HZ = 1000.0


def leaving_speed(radius_m: float, pitch_m: float, speed_m_s: float) -> tuple[Floats, Floats]:
    """Return the way of roller 2 since the wheel's top (m) and its speed (m/s), eqs. (1), (2).

    ``speed_m_s`` is that of the seats on the pitch circle.
    """
    first = pi / 2.0 - 2.0 * asin(pitch_m / (2.0 * radius_m))
    alpha = np.linspace(first, pi / 2.0, 2001)
    below = radius_m * (1.0 - np.sin(alpha))
    way = -radius_m * np.cos(alpha) + np.sqrt(pitch_m**2 - below**2)
    # eq. (2) with its fraction multiplied out: it is 0/0 as printed at alpha = pi/2
    share = np.cos(alpha) * below / np.sqrt(pitch_m**2 - below**2)
    return way, speed_m_s * (np.sin(alpha) + share)


def simulated_speed(machine: Machine, factor: float, direction: int) -> tuple[Floats, Floats]:
    """Return the same of a roller of a simulated machine with a wheel.

    The stiff machine's wheel holds its seats as much harder as its links pull.
    """
    p = start(machine, case(SPEED_M_S, direction), 5.0, factor=1.0).simulation.parameters
    edge = p.drive_end if direction > 0 else p.drive_start
    pitch = machine.chain.pitch_m
    seats = p.drive_stiffness * factor
    before = edge - direction * BEFORE_PITCHES * pitch
    trial = start(
        machine, case(SPEED_M_S, direction), before, factor=factor, drive_stiffness=seats
    )
    duration = (BEFORE_PITCHES + 1.2) * pitch / abs(trial.simulation.chain_speed_m_s)
    place = trial.record(round(duration, 2), RATE_HZ, (run.PLACE, 0, 0))[:, 0]
    way = direction * (place - edge)
    return way, np.gradient(way) * RATE_HZ


def deviation(machine: Machine, factor: float, direction: int) -> Floats:
    """Return the relative deviation of the simulated speed from eq. (2) over the curve."""
    way, speed = simulated_speed(machine, factor, direction)
    pitch = machine.chain.pitch_m
    on = (way > 0.0) & (way < pitch)
    exact = leaving_speed(machine.guide.turnaround_radius_m, pitch, SPEED_M_S)
    return speed[on] / np.interp(way[on], *exact) - 1.0


def figures(machine: Machine) -> list[Figure]:
    """Return the figures of a machine whose drive is a wheel."""
    subject = 'eqs. (1), (2): roller leaving the wheel at 0.5 m/s'
    found = []
    for name, direction in (('up', 1), ('down', -1)):
        stiff = np.abs(deviation(ideal(machine), STIFF, direction)).max()
        plain = np.abs(deviation(machine, 1.0, direction)).max()
        found += [
            Figure(subject, f'largest deviation, stiff limit, {name}', 100 * stiff, '%', 1.0),
            Figure(subject, f'largest deviation, as designed, {name}', 100 * plain, '%'),
        ]
    exact = leaving_speed(machine.guide.turnaround_radius_m, machine.chain.pitch_m, SPEED_M_S)[1]
    ripple = 100 * np.ptp(exact) / SPEED_M_S
    return [*found, Figure(subject, 'ripple of the speed itself, peak to peak', ripple, '%')]


def plots(machine: Machine) -> dict[str, str]:
    """Return plots by file name."""
    pitch = machine.chain.pitch_m
    way, speed = leaving_speed(machine.guide.turnaround_radius_m, pitch, SPEED_M_S)
    lines = [Line('eq. (2)', way / pitch, speed)]
    for label, one, factor in (
        ('stiff limit (x 30)', ideal(machine), STIFF),
        ('as designed', machine, 1.0),
    ):
        way, speed = simulated_speed(one, factor, 1)
        on = (way > 0.0) & (way < pitch)
        lines.append(Line(label, way[on] / pitch, speed[on]))
    title = 'Speed of a roller that leaves the wheel, 0.5 m/s at the pitch circle'
    return {'wheel.svg': svg(title, 'way since the wheel, pitches', 'speed, m/s', lines)}
