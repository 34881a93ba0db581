"""What must not matter: which side is which, one model or the other, where a run begins."""

from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt

from escalator_twin.machine import Machine
from escalator_twin.physics import run
from escalator_twin.physics.parameters import make_parameters
from escalator_twin.signals import Experiment, Floats
from escalator_twin.verification.figure import Figure
from escalator_twin.verification.trial import case, start, Trial

RATE_HZ = 200.0
DURATION_S = 5.0
LEFT, RIGHT = 0, 1


def lopsided(machine: Machine, heavy: int) -> Trial:
    """Return a run whose one side carries more load, more mass and a dragging roller."""
    experiment = case(0.5, load_kg=75.0)
    p = make_parameters(machine, experiment)
    share = np.full((2, 1), 0.8)
    share[heavy] = 1.2
    drag = np.zeros_like(p.roller_drag)
    drag[heavy, 3] = 120.0
    mass = p.end_mass * (1.0 + 0.1 * (share - 1.0))
    load = p.load * share
    return start(
        machine, experiment, 5.0, planar=False, load=load, roller_drag=drag, end_mass=mass
    )


def mirror_miss(machine: Machine) -> tuple[float, float]:
    """Return the largest differences between a lopsided run and its mirror image.

    Returns
    -------
    force : float
        Of link forces, N.
    acceleration : float
        Of a step across the way, where both sides follow one line, m/s2.
    """
    columns = []
    for heavy in (LEFT, RIGHT):
        trial = lopsided(machine, heavy)
        sides = (heavy, 1 - heavy)
        probes = [(run.LINK_FORCE, i, side) for i in (0, 20, 40) for side in sides]
        columns.append(trial.record(DURATION_S, RATE_HZ, *probes, (run.ACCEL_Y, 0, 0)))
    apart = np.abs(columns[0] - columns[1]).max(axis=0)
    return float(apart[:-1].max()), float(apart[-1])


def planar_miss(machine: Machine, experiment: Experiment) -> float:
    """Return the largest difference of link forces of the planar model from both sides', N."""
    probes = [(run.LINK_FORCE, i, 0) for i in (0, 20, 40)]
    both, lumped = (
        start(machine, experiment, 5.0, planar=planar).record(DURATION_S, RATE_HZ, *probes)
        for planar in (False, True)
    )
    return float(np.abs(both - lumped).max())


def start_miss(machine: Machine) -> float:
    """Return the rms difference (N, 0 to 20 Hz) of link 0's force at one place in three runs.

    They began elsewhere on the loop, by no whole number of pitches.
    """
    speed = 0.5
    records: list[Floats] = []
    for before in (0.0, 2.9, 7.3):
        trial = start(machine, case(speed, load_kg=75.0), 8.5 - before)
        duration = round((before + 7.5) / speed, 2)
        records.append(trial.record(duration, RATE_HZ, (run.PLACE, 0, 0), (run.LINK_FORCE, 0, 0)))
    grid = np.linspace(9.0, 15.0, 2400)
    sections = butter(4, 20.0, fs=RATE_HZ, output='sos')
    forces = np.array(
        [CubicSpline(r[:, 0], sosfiltfilt(sections, r[:, 1]))(grid) for r in records]
    )
    apart = forces - forces[0]
    return float(np.sqrt((apart[1:] ** 2).mean(axis=1)).max())


def figures(machine: Machine) -> list[Figure]:
    """Return the figures of this page."""
    subject = 'symmetry and invariance'
    loaded = case(0.5, 1, 75.0, 6000.0)
    exact = replace(machine, deviations=())
    force, across = mirror_miss(exact)
    exchanged = 'left and right exchanged'
    return [
        Figure(subject, f'{exchanged}: link forces', force, 'N', 1e-3),
        Figure(subject, f'{exchanged}: step acceleration y', across, 'm/s2', 1e-6),
        Figure(
            subject,
            'planar model against both sides: link forces',
            planar_miss(exact, loaded),
            'N',
            1e-3,
        ),
        Figure(
            subject,
            'start elsewhere on the loop: link force, 0 to 20 Hz, rms',
            start_miss(exact),
            'N',
            3.0,
        ),
    ]
