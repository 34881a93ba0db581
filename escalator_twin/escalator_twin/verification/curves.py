"""What compensated curves leave of the polygon effect.

Three guides: as designed, turnarounds compensated, all curves compensated. The carriage's motion
at the pitch frequency is compared between the rigid polygon and the stiff machine, and shown for
the elastic one, beside the ripple of an axle's speed where the drive does not hold it.
"""

from dataclasses import replace

import numpy as np

from escalator_twin.machine import Machine
from escalator_twin.physics import run
from escalator_twin.physics.path import build_path
from escalator_twin.physics.profile import circular
from escalator_twin.physics.profile import compensated as profile
from escalator_twin.signals import Experiment
from escalator_twin.verification.figure import Figure
from escalator_twin.verification.plot import Line, svg
from escalator_twin.verification.polygon_limit import (
    first_harmonic,
    machine_motion,
    PHASES,
    polygon_motion,
)
from escalator_twin.verification.trial import case, ideal, start

STIFF = 30.0
SLOW_M_S = 0.25
MOST_LEFT = 2.0  # % of the circular guide's motion
SHARE_WITHIN = 5.0  # %


def compensated(machine: Machine, transitions: bool = True) -> Machine:
    """Return a machine whose turnarounds, and transitions if asked, are compensated."""
    guide = replace(
        machine.guide,
        turnaround_profile='compensated',
        transition_profile='compensated' if transitions else 'circular',
        profile_pitch_m=machine.chain.pitch_m,
    )
    return replace(machine, guide=guide)


def rigid_harmonic(machine: Machine) -> float:
    """Return the amplitude (m) of the rigid polygon's carriage motion at the pitch frequency."""
    chain = machine.chain
    return abs(
        first_harmonic(polygon_motion(build_path(machine.guide), chain.n_links, chain.pitch_m))
    )


def elastic_harmonic(machine: Machine, experiment: Experiment, factor: float = 1.0) -> float:
    """Return the amplitude (m) of a machine's carriage motion at the pitch frequency."""
    return abs(first_harmonic(machine_motion(machine, experiment, factor)))


def speed_ripple(machine: Machine, experiment: Experiment) -> float:
    """Return the rms ripple of axle 0's speed on the return run's incline over its mean."""
    middle = 0.75 * build_path(machine.guide).length_m
    pitch = machine.chain.pitch_m
    trial = start(machine, experiment, middle)
    duration = round(4.0 * pitch / experiment.set_speed_m_s, 2)
    place = trial.record(duration, 1000.0, (run.PLACE, 0, 0))[:, 0]
    speed = np.gradient(place)
    return float(speed.std() / abs(speed.mean()))


def figures(machine: Machine) -> list[Figure]:
    """Return the figures of this page."""
    subject, plain = 'compensated curves', ideal(machine)
    turned, full = compensated(plain, transitions=False), compensated(plain)
    circle, left, share = (rigid_harmonic(m) for m in (plain, full, turned))
    slow = case(SLOW_M_S)
    stiff = [elastic_harmonic(m, slow, STIFF) for m in (plain, full, turned)]
    name = 'amplitude at the pitch frequency'
    found = [
        Figure(subject, f'rigid polygon, circular: {name}', 1e3 * circle, 'mm'),
        Figure(
            subject,
            'rigid polygon, all compensated, of circular',
            100 * left / circle,
            '%',
            MOST_LEFT,
        ),
        Figure(
            subject, 'rigid polygon, transitions alone, of circular', 100 * share / circle, '%'
        ),
        Figure(
            subject,
            'stiff x 30, all compensated, of circular',
            100 * stiff[1] / stiff[0],
            '%',
            MOST_LEFT,
        ),
        Figure(
            subject,
            "stiff x 30, turnarounds compensated: the transitions' share against the polygon's",
            100 * abs(stiff[2] / share - 1.0),
            '%',
            SHARE_WITHIN,
        ),
    ]
    for speed in (SLOW_M_S, 0.5):
        there = case(speed)
        for label, one in (('circular', machine), ('all compensated', compensated(machine))):
            amplitude, ripple = elastic_harmonic(one, there), speed_ripple(one, there)
            found += [
                Figure(
                    subject, f'as designed, {label}, {speed} m/s: {name}', 1e3 * amplitude, 'mm'
                ),
                Figure(
                    subject,
                    f'as designed, {label}, {speed} m/s: rms speed ripple',
                    100 * ripple,
                    '%',
                ),
            ]
    return found


def plots(machine: Machine) -> dict[str, str]:
    """Return plots by file name."""
    guide, pitch = machine.guide, machine.chain.pitch_m
    shapes, lines = {}, []
    for label, curve in (
        ('circle', circular(np.pi, guide.turnaround_radius_m)),
        ('compensated', profile(np.pi, guide.turnaround_radius_m, pitch)),
    ):
        length, turn = np.array(curve).T
        ends = np.repeat(np.concatenate([[0.0], np.cumsum(length)]), 2)
        bend = np.concatenate([[0.0], np.repeat(turn / length, 2), [0.0]])
        lines.append(Line(label, ends, bend))
    title = 'Turnaround: curvature along the path'
    shapes['profile.svg'] = svg(title, 'path, m', 'curvature, 1/m', lines)
    phase = np.arange(PHASES) / PHASES
    lines = []
    for label, one in (
        ('circular', machine),
        ('turnarounds compensated', compensated(machine, transitions=False)),
        ('all compensated', compensated(machine)),
    ):
        u = machine_motion(one, case(0.5))
        lines.append(Line(label, phase, 1e3 * (u - u.mean())))
    title = 'Carriage of the elastic machine at 0.5 m/s, mean removed'
    shapes['curves.svg'] = svg(title, 'phase, pitches', 'displacement, mm', lines)
    return shapes
