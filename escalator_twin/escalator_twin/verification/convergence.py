"""The time step: order of convergence, and the error of the step in use.

Runs with different steps begin at moments that differ by less than a step. Their rows are brought
together by the rack's travel, which is the same function of time in all of them.
"""

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt

from escalator_twin.machine import Machine
from escalator_twin.physics import run
from escalator_twin.physics.rollout import STEP_S
from escalator_twin.signals import Experiment, Floats
from escalator_twin.verification.figure import Figure
from escalator_twin.verification.trial import case, ideal, start

DURATION_S = 12.0
RATE_HZ = 200.0
CUTOFF_HZ = 20.0
EDGE_S = 1.0
STEPS_S = (5e-3, 2.5e-3, 1.25e-3)
FINE_S = 1.5625e-4


def course(machine: Machine, experiment: Experiment, step_s: float, planar: bool) -> Floats:
    """Return the rack's travel (m) and the forces of all links (N), one row a sample."""
    trial = start(machine, experiment, 5.0, planar=planar, step_s=step_s)
    sides, links = (0,) if planar else (0, 1), range(machine.chain.n_links)
    probes = [(run.LINK_FORCE, link, side) for side in sides for link in links]
    return trial.record(DURATION_S, RATE_HZ, (run.RACK, 0, 0), *probes)


def difference(one: Floats, other: Floats, cutoff_hz: float | None) -> Floats:
    """Return the difference of forces at the first run's travel, low-passed if asked, ends off."""
    sign = np.sign(other[-1, 0] - other[0, 0])
    moved = CubicSpline(sign * other[:, 0], other[:, 1:])(sign * one[:, 0])
    rows = one[:, 1:] - moved
    if cutoff_hz is not None:
        rows = sosfiltfilt(butter(4, cutoff_hz, fs=RATE_HZ, output='sos'), rows, axis=0)
    edge = round(EDGE_S * RATE_HZ)
    trimmed: Floats = rows[edge:-edge]
    return trimmed


def step_error(machine: Machine, experiment: Experiment, step_s: float) -> tuple[float, float]:
    """Return rms and largest error of link forces, 0 to 20 Hz, against a tenth of the step, N.

    Of the link whose error is largest.
    """
    rows = difference(
        course(machine, experiment, step_s, planar=False),
        course(machine, experiment, step_s / 10.0, planar=False),
        CUTOFF_HZ,
    )
    return float(np.sqrt((rows**2).mean(axis=0)).max()), float(np.abs(rows).max())


def order(machine: Machine) -> float:
    """Return the order of convergence of link forces on an exact guide without clearance."""
    plain, at = ideal(machine), case(0.25)
    fine = course(plain, at, FINE_S, planar=True)
    errors = [
        float(difference(course(plain, at, h, planar=True), fine, CUTOFF_HZ).std())
        for h in STEPS_S
    ]
    return float(np.polyfit(np.log(STEPS_S), np.log(errors), 1)[0])


def figures(machine: Machine) -> list[Figure]:
    """Return the figures of this page."""
    subject = 'time step'
    found = [Figure(subject, 'order of convergence, exact guide', order(machine), '', 2.3, 1.8)]
    for direction, name in ((1, 'up'), (-1, 'down')):
        rms, most = step_error(machine, case(0.5, direction, 75.0, 6000.0), STEP_S)
        at = f'step of {1e3 * STEP_S:g} ms, loaded, 6 kN, {name}'
        found += [
            Figure(subject, f'{at}: link force against a tenth of it, rms', rms, 'N', 3.0),
            Figure(subject, f'{at}: the same, largest', most, 'N', 15.0),
        ]
    return found
