"""Gravity as the step's accelerometer sees it: it turns with the link, all round the loop.

At walking pace nothing else accelerates the step noticeably; the sensor then reads the upward
9.81 m/s2 in the step's frame, whose x axis is link 0. The link's angle comes from the rigid
polygon (``physics.polygon``), not from the simulation.
"""

import numpy as np

from escalator_twin.machine import Machine
from escalator_twin.physics import run
from escalator_twin.physics.path import build_path, point_at
from escalator_twin.physics.polygon import next_place
from escalator_twin.signals import Floats
from escalator_twin.verification.figure import Figure
from escalator_twin.verification.trial import case, ideal, start

SPEED_M_S = 0.05
STIFF = 30.0
RATE_HZ = 10.0


def expected(machine: Machine, place: Floats, carriage: Floats) -> Floats:
    """Return what gravity puts on x and z of a step at rest whose axle is at each place."""
    path, pitch = build_path(machine.guide), machine.chain.pitch_m
    rows = []
    for s, u in zip(place % path.length_m, carriage, strict=True):
        ahead = next_place(path.segments, path.length_m, s, u, pitch, 1.0)
        here = point_at(path.segments, path.length_m, s, u)
        there = point_at(path.segments, path.length_m, ahead, u)
        rows.append([(there[1] - here[1]) / pitch, (there[0] - here[0]) / pitch])
    return machine.gravity_m_s2 * np.array(rows)


def readings(machine: Machine) -> tuple[Floats, Floats]:
    """Return what the sensor reads over a whole loop, slowly, and what gravity is there."""
    one = ideal(machine)
    trial = start(one, case(SPEED_M_S), 5.0, factor=STIFF)
    loop_s = round(machine.chain.n_links * machine.chain.pitch_m / SPEED_M_S, 1)
    probes = ((run.PLACE, 0, 0), (run.CARRIAGE, 0, 0), (run.ACCEL_X, 0, 0), (run.ACCEL_Z, 0, 0))
    table = trial.record(loop_s, RATE_HZ, *probes)
    # the landing's coordinates end at the carriage's rest position: stay off the seam
    length = trial.simulation.path.length_m
    clear = np.abs((table[:, 0] + 0.5 * length) % length - 0.5 * length) > machine.chain.pitch_m
    rows = table[clear]
    return rows[:, 2:], expected(one, rows[:, 0], rows[:, 1])


def figures(machine: Machine) -> list[Figure]:
    """Return the figures of this page."""
    subject = 'gravity in the step frame'
    read, gravity = readings(machine)
    apart = np.abs(read - gravity)
    return [
        Figure(
            subject,
            'whole loop at 0.05 m/s: largest difference on x',
            apart[:, 0].max(),
            'm/s2',
            0.1,
        ),
        Figure(
            subject,
            'whole loop at 0.05 m/s: largest difference on z',
            apart[:, 1].max(),
            'm/s2',
            0.1,
        ),
        Figure(
            subject,
            'whole loop at 0.05 m/s: rms difference',
            float(np.sqrt((apart**2).mean())),
            'm/s2',
            0.02,
        ),
        Figure(subject, 'reading on z, least', read[:, 1].min(), 'm/s2', -9.7, -9.9),
        Figure(subject, 'reading on z, most', read[:, 1].max(), 'm/s2', 9.9, 9.7),
    ]
