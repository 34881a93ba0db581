"""One loop of the machine at steady speed, seen from every link and every step.

A closed chain of like links is the same machine again after one pitch of travel, every part
having taken the place of the one before. A deviation bound to one link is therefore run once, at
index 0, with the forces of all links and the accelerations of all steps recorded; at index j it
looks the same as at 0 from a place j parts further. One run stands for all places of the cause.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from escalator_twin.diagnosis.grids import (
    band_limited,
    Frame,
    Loop,
    Origin,
    RATE_HZ,
    shift_of,
)
from escalator_twin.machine import Deviation, Machine, Sensor
from escalator_twin.physics import run
from escalator_twin.physics.periodic import between, is_uniform, Pitch, record_pitch
from escalator_twin.physics.rollout import probe_of, Simulation
from escalator_twin.signals import Experiment, Floats
from escalator_twin.twin import make_folded

# Of the simulations, which are many. Below ``BAND_HZ`` a link's force is off by 0.3 to 1 N against a
# step of 0.25 ms, as much as the gauges' noise leaves open (tests/test_diagnosis_loops.py).
STEP_S = 5e-3 / 3.0
MARGIN_S = 1.0  # simulated beyond both ends of a loop: for the low-pass, and for the rack's dogs
# Beyond both ends of a pitch, for the low-pass alone: exp(-12) is left of it.
PITCH_MARGIN_S = 0.25
# Causes bound to one link, axle or step, and waves of the drive: beside them the chain is no longer
# the same after a pitch.
LOCAL = frozenset({
    'link_elongation', 'link_stiffness', 'roller_drag', 'roller_eccentricity', 'roller_flat',
    'load_distribution', 'step_mass', 'drive_ripple', 'drive_hunting',
})  # fmt: skip


def alike(machine: Machine, experiment: Experiment) -> tuple[Machine, Experiment]:
    """Return a machine without what singles out one link, axle or step, equally loaded.

    It is the same again after every pitch, and quickly run; what a tolerance or the rail does to it
    is next to what they do to the machine itself.
    """
    kept = tuple(d for d in machine.deviations if d.cause not in LOCAL)
    loads = experiment.load_per_step_kg
    return replace(machine, deviations=kept), replace(
        experiment, load_per_step_kg=(float(np.mean(loads)),)
    )


def sensor_probes(sensors: tuple[Sensor, ...], n_links: int) -> np.ndarray:
    """Return the probes of some sensors, (k, 3)."""
    return np.array([probe_of(s, n_links) for s in sensors], dtype=np.int64)


def all_probes() -> np.ndarray:
    """Return the probe of everything: carriage, all links of both sides, all steps."""
    return np.array([(run.EVERYTHING, 0, 0)], dtype=np.int64)


def simulate_loop(
    machine: Machine,
    experiment: Experiment,
    frame: Frame,
    probes: np.ndarray,
    deviations: tuple[Deviation, ...] = (),
    origin: Origin = None,
) -> Loop:
    """Simulate one loop, from about path coordinate 0 on, and put it onto the grid.

    Parameters
    ----------
    machine : Machine
    experiment : Experiment
        ``set_speed_m_s`` is that of the frame.
    frame : Frame
    probes : (k, 3) int64
    deviations : tuple of Deviation
        Beside those of the machine.
    origin : float or Begin, optional
        From where travel is counted: as in a loop with this ``rack_m``, so that the rack's dogs stand
        alike; or as a recording's run begins.
    """
    machine = replace(machine, deviations=(*machine.deviations, *deviations))
    simulation = built(machine, experiment)
    length = simulation.path.length_m
    if is_uniform(simulation.parameters):
        pitch = record_pitch(simulation, RATE_HZ, PITCH_MARGIN_S)
        if pitch is not None:
            return _tiled(pitch, frame, probes, origin)
        simulation = built(machine, experiment)
    speed = simulation.chain_speed_m_s
    simulation.start((-speed * MARGIN_S) % length)
    is_all = bool(probes[0, 0] == run.EVERYTHING)
    place = np.array([(run.PLACE, 0, 0), (run.RACK, 0, 0)], dtype=np.int64)
    duration = frame.n_loop * frame.spacing_m / frame.speed_m_s + 2.0 * MARGIN_S
    record = simulation.advance(
        duration, RATE_HZ, probes if is_all else np.vstack([place, probes])
    )
    grid = np.asarray(np.arange(frame.n_loop + 1) * frame.spacing_m, np.float64)
    way = float(record[0, 1]) * simulation.dog_pitch
    rack = way * experiment.direction + abs(speed) * MARGIN_S
    unwrapped = np.unwrap(record[:, 0], period=length)
    unwrapped -= length * np.round(unwrapped[0] / length)
    travel = (np.arange(len(unwrapped)) / RATE_HZ - MARGIN_S) * abs(speed)
    shift = shift_of(origin, rack, travel, unwrapped, length, frame.pitch_m)
    where = ((grid - shift) / abs(speed) + MARGIN_S) * RATE_HZ
    seen = record[:, 2 : 3 + 5 * frame.n_links] if is_all else record[:, 2:]
    inside, rows = where[:-1], np.arange(len(unwrapped))
    return Loop(
        between(band_limited(seen.astype(np.float32), RATE_HZ), inside),
        np.interp(inside, rows, unwrapped),
        float(length * experiment.direction),
        rack - shift,
        np.interp(where, rows, record[:, -1]) if is_all else None,
    )


def built(machine: Machine, experiment: Experiment) -> Simulation:
    return make_folded(machine, experiment, STEP_S)


def simulate_rails(
    machine: Machine,
    experiment: Experiment,
    frame: Frame,
    probes: np.ndarray,
    rails: Sequence[Floats],
    jobs: int = 1,
    origin: Origin = None,
) -> list[np.ndarray]:
    """Simulate one loop with each of several small deviations of the rail.

    Parameters
    ----------
    machine : Machine
        Of which all links are alike, see ``alike``.
    experiment : Experiment
        ``set_speed_m_s`` is that of the frame.
    frame : Frame
    probes : (k, 3) int64
    rails : sequence of (n, 2) float64
        What the guide has beyond its survey: m and its slope, see `Simulation.lay`.
    jobs : int
        Simulations at a time.
    origin : float or Begin, optional
        Of travel, see `simulate_loop`.

    Returns
    -------
    changes : list of (n_loop, k) float32
        One for each rail that the machine runs over steadily.
    """
    first = built(machine, experiment)
    assert is_uniform(first.parameters), 'one pitch stands for no other machine'
    first.start(0.0)
    kept = first.keep()

    def runs(simulation: Simulation, rail: Floats | None, origin: Origin) -> Loop | None:
        simulation.back_to(kept)
        if rail is not None:
            simulation.lay(rail)
        pitch = record_pitch(simulation, RATE_HZ, PITCH_MARGIN_S, goes_on=True)
        return None if pitch is None else _tiled(pitch, frame, probes, origin)

    base = runs(first, None, origin)
    if base is None:
        return []

    def some(part: Sequence[Floats]) -> list[np.ndarray | None]:
        simulation = built(machine, experiment)
        loops = (runs(simulation, rail, base.rack_m) for rail in part)
        return [None if loop is None else loop.columns - base.columns for loop in loops]

    count = max(1, jobs)
    with ThreadPoolExecutor(count) as pool:
        parts = pool.map(some, [rails[k::count] for k in range(count)])
    # in the rails' order, however many ran at a time: what follows must not hang on that
    found: list[np.ndarray | None] = [None] * len(rails)
    for k, part in enumerate(parts):
        found[k::count] = part
    return [change for change in found if change is not None]


def _tiled(pitch: Pitch, frame: Frame, probes: np.ndarray, origin: Origin) -> Loop:
    """Put the loop of a uniform machine together from one pitch of it."""
    times, places = pitch.places()
    n, d, period, length = pitch.n_links, pitch.direction, pitch.period_s, pitch.length_m
    # the loop begins with axle 0 at path coordinate 0
    way = d * places
    begin = float(np.interp(way[0] + (-way[0]) % length, way, times)) % (n * period)
    rack = d * (pitch.rack_m + pitch.speed_m_s * begin)
    travel = abs(pitch.speed_m_s) * (times - begin)
    shift = shift_of(origin, rack, travel, places, length, frame.pitch_m)
    first = begin - shift / abs(pitch.speed_m_s)
    # the grid's points lie at the same phases in every pitch
    grid = first + np.arange(frame.per_pitch) * (period / frame.per_pitch)
    turn = np.floor(grid / period).astype(int)
    where = (grid - turn * period + pitch.margin_s) * pitch.rate_hz
    seen = pitch.rows[:, : 1 + 5 * n].astype(np.float32)
    phases = between(band_limited(seen, pitch.rate_hz), where)
    is_all = bool(probes[0, 0] == run.EVERYTHING)
    columns = np.empty((n, frame.per_pitch, 1 + 5 * n if is_all else len(probes)), np.float32)
    for at in np.unique(turn):
        rows = turn == at
        ahead = np.arange(n) + int(at)
        picked = (
            _all_columns(n, d * ahead)
            if is_all
            else np.stack([pitch.column(probe, ahead) for probe in probes], axis=1)
        )
        columns[:, rows] = phases[rows][:, picked].swapaxes(0, 1)
    clock = first + np.arange(frame.n_loop) * (period / frame.per_pitch)
    loops = np.floor(clock / (n * period))
    place = np.interp(clock - loops * n * period, times, places) + d * length * loops
    place -= length * np.round(place[0] / length)
    return Loop(columns.reshape(frame.n_loop, -1), place, float(length * d), rack - shift)


def _all_columns(n: int, ahead: np.ndarray) -> np.ndarray:
    """Return the columns of all probes, every part some places further, (len(ahead), 1 + 5 n)."""
    place = (np.arange(n) + ahead[:, None]) % n
    carriage = np.zeros((len(ahead), 1), place.dtype)
    return np.concatenate([carriage, *(1 + k * n + place for k in range(5))], axis=1)
