"""What the rail may have that its survey does not show, and what that does to the signals.

A survey has an error, and waves shorter than twice its spacing are not in it. Every roller passes
them once a pitch, so that all of the chain is shaken alike, at multiples of the pitch, with the chain
swinging between drive and carriage: a pattern over place, not noise. Rails are drawn from what the
survey leaves open, the machine is run with each, and the directions in which the signals spread
most are nuisance like any other tolerance.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from escalator_twin.diagnosis.grids import Frame, Origin
from escalator_twin.diagnosis.loops import alike, sensor_probes, simulate_rails
from escalator_twin.diagnosis.whitening import sensor_variance
from escalator_twin.machine import Machine, Sensor
from escalator_twin.physics.path import build_path
from escalator_twin.physics.survey import read_survey, spectrum_of, STEP_M
from escalator_twin.signals import Experiment, Floats

DRAWS = 80
SEED = 20  # of the rails: the same for every recording
SHORTEST_M = 0.04  # a roller of 80 mm does not follow shorter waves
SEEN = 0.7  # of the sensors' noise over a loop: a direction that shows less is left out


def draw_rails(machine: Machine, count: int = DRAWS, seed: int = SEED) -> list[Floats]:
    """Draw what a rail may have beyond its survey.

    The survey's spectrum is a power law P and white noise N, see `without_error`. A wave that was
    surveyed is known to P N / (P + N); a shorter one is open to P, the law taken on.

    Parameters
    ----------
    machine : Machine
    count, seed : int

    Returns
    -------
    rails : list of (n, 2) float64
        Normal deviation (m) and its slope on the grid of the survey's table; empty without a survey.
    """
    name = machine.guide.survey_file
    if name is None:
        return []
    length = build_path(machine.guide).length_m
    s, normal, _ = read_survey((machine.source.parent if machine.source else Path()) / name)
    points = normal[s < length - 0.5 * float(np.median(np.diff(s)))]
    error = machine.guide.survey_error_m
    level, slope = spectrum_of(points, error)
    number = np.arange(1, int(length / SHORTEST_M) + 1)
    power = np.exp(level - slope * np.log(number))
    surveyed = number <= len(points) // 2
    is_open = np.where(surveyed, power * error**2 / (power + error**2), power)
    amplitude = np.sqrt(2.0 * is_open / len(points))
    grid = round(length / STEP_M)
    random = np.random.default_rng(seed)
    rails = []
    for _ in range(count):
        waves = np.zeros(grid // 2 + 1, complex)
        parts = random.normal(size=(2, len(number))) * amplitude
        waves[number] = 0.5 * grid * (parts[0] - 1j * parts[1])
        slopes = waves * (2j * np.pi / length) * np.arange(len(waves))
        rails.append(np.column_stack([np.fft.irfft(waves, grid), np.fft.irfft(slopes, grid)]))
    return rails


def rail_columns(
    machine: Machine, experiment: Experiment, frame: Frame, jobs: int = 1, origin: Origin = None
) -> np.ndarray:
    """Return what the open part of the rail does to the channels, as columns of unit variance.

    Parameters
    ----------
    machine : Machine
        What singles out one of its links does nothing here.
    experiment : Experiment
        At the frame's speed.
    frame : Frame
    jobs : int
        Simulations at a time.
    origin : float or Begin, optional
        Of travel, see `simulate_loop`.

    Returns
    -------
    columns : (n_loop, c, q) float32
        Of a step's z it says nothing: there a rail shows at its own place, once a loop.
    """
    sensors = machine.instruments.sensors
    rails = draw_rails(machine)
    if not rails:
        return np.zeros((frame.n_loop, len(sensors), 0), np.float32)
    seen = sensor_probes(sensors, machine.chain.n_links)
    machine, experiment = alike(machine, replace(experiment, set_speed_m_s=frame.speed_m_s))
    found = simulate_rails(machine, experiment, frame, seen, rails, jobs, origin)
    if not found:
        return np.zeros((frame.n_loop, len(sensors), 0), np.float32)
    changes = np.stack(found, axis=2) / np.float32(len(found) ** 0.5)
    changes[:, [sensor.at.get('axis') == 'z' for sensor in sensors]] = 0.0
    return _leading(changes, sensors, frame.rate_hz)


def _leading(changes: np.ndarray, sensors: Sequence[Sensor], rate_hz: float) -> np.ndarray:
    """Return the directions of an ensemble (n, c, k) that show beside the sensors' noise."""
    noise = np.array([sensor_variance(sensor, rate_hz) ** 0.5 for sensor in sensors], np.float32)
    white = (changes / noise[None, :, None]).reshape(-1, changes.shape[2])
    power, turn = np.linalg.eigh((white.T @ white).astype(np.float64))
    strong = power[::-1] > SEEN**2
    found: np.ndarray = changes @ turn[:, ::-1][:, strong].astype(np.float32)
    return found
