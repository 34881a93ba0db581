"""The carriage's motion against the rigid polygon, which the stiff machine must approach.

Links of exactly one pitch, inscribed in the guide's centre line, leave the carriage one place for
every place of the chain. That is geometry alone (``physics.polygon``); no force enters it.
"""

from dataclasses import dataclass

import numpy as np

from escalator_twin.machine import Machine
from escalator_twin.physics import run
from escalator_twin.physics.path import build_path, GuidePath
from escalator_twin.physics.polygon import inscribe
from escalator_twin.signals import Experiment, Floats
from escalator_twin.verification.figure import Figure
from escalator_twin.verification.plot import Line, svg
from escalator_twin.verification.trial import case, ideal, start

FROM_M = 2.0  # on the straight incline, where a place recurs after exactly one pitch
PITCHES = 10
PHASES = 64
FACTORS = (10.0, 30.0)
SPEEDS_M_S = (0.05, 0.25)


@dataclass(frozen=True)
class Departure:
    """How a machine's carriage motion differs from the rigid polygon's.

    Attributes
    ----------
    rms : float
        Root mean square difference over that of the polygon's motion, means removed.
    span, harmonic : float
        Peak-to-peak and amplitude at the pitch frequency over the polygon's, less one.
    """

    rms: float
    span: float
    harmonic: float


def polygon_motion(path: GuidePath, n_links: int, pitch_m: float) -> Floats:
    """Return the carriage's place (m) over one pitch of the chain's, at ``PHASES`` even phases."""
    chords = np.full(n_links, pitch_m)
    places = FROM_M + pitch_m * np.arange(PHASES) / PHASES
    return np.array([inscribe(path, chords, place)[1] for place in places])


def first_harmonic(motion: Floats) -> complex:
    """Return the amplitude and phase of a motion over one pitch at its first harmonic."""
    return complex(2.0 * np.fft.rfft(motion)[1] / len(motion))


def machine_motion(machine: Machine, experiment: Experiment, factor: float = 1.0) -> Floats:
    """Return the simulated carriage's place over one pitch at even phases, mean of many pitches.

    ``factor`` times stiffer links and guide; axle 0 on the straight incline.
    """
    pitch = machine.chain.pitch_m
    at = FROM_M if experiment.direction > 0 else FROM_M + (PITCHES + 1) * pitch
    trial = start(machine, experiment, at, factor=factor)
    duration = (PITCHES + 0.5) * pitch / experiment.set_speed_m_s
    probes = ((run.PLACE, 0, 0), (run.CARRIAGE, 0, 0))
    place, u = trial.record(round(duration, 2), 1000.0, *probes).T
    order = np.argsort(place)
    first = place.min() + (FROM_M - place.min()) % pitch
    grid = first + pitch * np.arange(PITCHES * PHASES - PHASES) / PHASES
    return np.interp(grid, place[order], u[order]).reshape(-1, PHASES).mean(axis=0)


def departure(machine: Machine, experiment: Experiment, factor: float = 1.0) -> Departure:
    """Return how a machine's carriage motion differs from the rigid polygon's."""
    chain = machine.chain
    rigid = polygon_motion(build_path(machine.guide), chain.n_links, chain.pitch_m)
    moved = machine_motion(machine, experiment, factor)
    difference = (moved - moved.mean()) - (rigid - rigid.mean())
    return Departure(
        float(difference.std() / rigid.std()),
        float(np.ptp(moved) / np.ptp(rigid) - 1.0),
        abs(first_harmonic(moved)) / abs(first_harmonic(rigid)) - 1.0,
    )


def figures(machine: Machine) -> list[Figure]:
    """Return the figures of this page: the stiff limit, and how the elastic machine departs."""
    plain, subject = ideal(machine), 'rigid polygon'
    rigid = polygon_motion(build_path(plain.guide), machine.chain.n_links, machine.chain.pitch_m)
    found = [
        Figure(
            subject,
            'carriage motion of the rigid polygon, peak to peak',
            np.ptp(rigid) * 1e3,
            'mm',
        )
    ]
    for speed in SPEEDS_M_S:
        soft, stiff = (departure(plain, case(speed), factor) for factor in FACTORS)
        at = f'at {speed} m/s'
        found += [
            Figure(subject, f'rms departure, stiffness x 10, {at}', 100 * soft.rms, '%'),
            Figure(subject, f'rms departure, stiffness x 30, {at}', 100 * stiff.rms, '%', 0.5),
            Figure(
                subject,
                f'departure x 10 over x 30 (3 if it falls as 1/stiffness), {at}',
                soft.rms / stiff.rms,
                '',
                3.5,
                2.5,
            ),
        ]
    for speed in (0.05, 0.25, 0.5):
        for load, preload in ((0.0, 3000.0), (0.0, 6000.0), (75.0, 3000.0)):
            span = departure(machine, case(speed, 1, load, preload)).span
            name = f'as designed, {speed} m/s, {load:g} kg, {preload:g} N: peak to peak'
            found.append(Figure(subject, name, 100 * span, '%'))
    return found


def plots(machine: Machine) -> dict[str, str]:
    """Return plots by file name."""
    plain, pitch = ideal(machine), machine.chain.pitch_m
    phase = np.arange(PHASES) / PHASES
    curves = {
        'rigid polygon': polygon_motion(build_path(plain.guide), machine.chain.n_links, pitch),
        'links and guide x 30, 0.25 m/s': machine_motion(plain, case(0.25), FACTORS[1]),
        'as designed, 0.25 m/s': machine_motion(machine, case(0.25)),
        'as designed, 0.5 m/s': machine_motion(machine, case(0.5)),
    }
    lines = [Line(label, phase, 1e3 * (u - u.mean())) for label, u in curves.items()]
    title = 'Carriage over one pitch, mean removed'
    return {'polygon.svg': svg(title, 'phase, pitches', 'displacement, mm', lines)}
