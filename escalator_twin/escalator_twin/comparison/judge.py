"""Score the twin's signals against a recording's, both aligned by travel."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

from escalator_twin.comparison.locate import fit_all, FREE, Setting, WANDER
from escalator_twin.machine import Machine, Sensor
from escalator_twin.metrics import (
    Bands,
    machine_orders,
    remove_sensor_pose,
    score,
    side_scores,
    SideScore,
    split_bands,
    Track,
)
from escalator_twin.metrics.registry import QUICK, Score
from escalator_twin.physics.course import course_of
from escalator_twin.physics.rollout import Trace
from escalator_twin.signals import Floats
from escalator_twin.sync.template import Templates
from escalator_twin.sync.timeline import Timed
from escalator_twin.sync.travel import Fit, fit_travel, Ground, Guess, Travel

AXES = ('x', 'y', 'z')


@dataclass(frozen=True)
class Aligned:
    """One channel, measured beside simulated, on the instrument's own grid.

    Attributes
    ----------
    measured, simulated : (n,) float64
        SI; an acceleration's bias and rotation are taken out of the measured one.
    time_s : (n,) float64
        Reference time.
    travel_m : (n,) float64
        Since the twin's run began.
    place_m : (n,) float64
        Path coordinate of axle 0.
    valid : (n,) bool
    rate_hz : float
    """

    measured: Floats
    simulated: Floats
    time_s: Floats
    travel_m: Floats
    place_m: Floats
    valid: np.ndarray
    rate_hz: float


@dataclass(frozen=True)
class Judgement:
    """What a comparison found.

    Attributes
    ----------
    travel : Travel
        Over reference time, 0 where the twin's run begins.
    start_s_m : float
        Path coordinate of axle 0 at the first sample of the travelling logger.
    by_signals : Ground or None
        How the signals alone would move the reference's clock, modulo a pitch period.
    channels : mapping of channel to Aligned
    scores : mapping of channel to scores
    sides : mapping
        Left against right, by link, where both are measured.
    pose : mapping
        Bias (m/s2) and rotation (deg) of the acceleration sensor, where there is one.
    """

    travel: Travel
    start_s_m: float
    by_signals: Ground | None
    channels: Mapping[str, Aligned]
    scores: Mapping[str, Mapping[str, Score]]
    sides: Mapping[str, SideScore]
    pose: Mapping[str, tuple[float, ...]]


def judge(setting: Setting, trace: Trace, machine: Machine, with_scores: bool = True) -> Judgement:
    """Align a simulated run with its recording and score every channel.

    Parameters
    ----------
    setting : Setting
        What the run was started with.
    trace : Trace
        The run at ``RATE_HZ``, one column a sensor of the machine, in their order.
    machine : Machine
    with_scores : bool
        Otherwise it is only aligned: no score, no side, no clock by the signals.
    """
    sensors = machine.instruments.sensors
    columns = {s.channel: trace.columns[:, i] for i, s in enumerate(sensors)}
    way = trace.time_s * setting.experiment.set_speed_m_s
    length = course_of(machine).length_m
    corrected = _without_pose(setting, columns, way, sensors)
    templates = Templates.of_run(setting.experiment.set_speed_m_s, trace.time_s, columns)
    guess = Guess(
        setting.travel.base_m_s,
        wander=machine.drive.speed_wander or WANDER,
        travel=setting.travel,
    )
    fit = fit_all(corrected, templates, guess, machine, setting.comparisons)
    by_signals = None
    if with_scores:
        by_signals = _signals_alone(corrected, templates, guess, machine, fit)
    tracks = _moved(setting.tracks, fit.ground, machine)
    aligned, pose = _align(tracks, columns, way, sensors, fit.travel)
    aligned = {
        c: replace(a, place_m=np.interp(a.travel_m, way, trace.place_m) % length)
        for c, a in aligned.items()
    }
    bands = {c: bands_of(a, machine) for c, a in aligned.items()} if with_scores else {}
    scores = {c: score(b, QUICK) for c, b in bands.items()}
    ground = machine.instruments.channels_of(machine.instruments.reference_logger)
    riding = [t for c, t in tracks.items() if c not in ground] or list(tracks.values())
    first = min(float(t.time_s[0]) for t in riding)
    start = np.interp(fit.travel.at(np.array([first])), way, trace.place_m)[0] % length
    sides = _sides(bands, sensors)
    return Judgement(fit.travel, float(start), by_signals, aligned, scores, sides, pose)


def _moved(tracks: Mapping[str, Timed], ground: Ground, machine: Machine) -> dict[str, Timed]:
    """Return the tracks with the reference logger's time moved as the signals ask."""
    if ground.shift_s == 0.0 and ground.rate == 0.0:
        return dict(tracks)
    channels = machine.instruments.channels_of(machine.instruments.reference_logger)
    return {
        c: replace(t, time_s=t.time_s + ground.shift_s + ground.rate * t.time_s)
        if c in channels
        else t
        for c, t in tracks.items()
    }


def _signals_alone(
    tracks: Mapping[str, Timed],
    templates: Templates,
    guess: Guess,
    machine: Machine,
    fit: Fit,
) -> Ground | None:
    """Return how the signals alone would move the reference's clock; None with one logger."""
    ground = machine.instruments.channels_of(machine.instruments.reference_logger)
    there = ground & set(tracks)
    if not there or there == set(tracks):
        return None
    start = replace(FREE, shift_s=fit.ground.shift_s, rate=fit.ground.rate)
    guess = replace(guess, travel=fit.travel)
    return fit_travel(tracks, templates, guess, ground, start).ground


def _simulated(track: Timed, column: Floats, way: Floats, travel: Travel) -> tuple[Floats, Floats]:
    """Return travel and simulated values at a track's samples."""
    place = travel.at(track.time_s)
    return place, CubicSpline(way, column)(np.clip(place, way[0], way[-1]))


def _triads(sensors: tuple[Sensor, ...]) -> list[dict[str, str]]:
    """Return the acceleration sensors as mappings of axis to channel, one a step."""
    steps: dict[object, dict[str, str]] = {}
    for sensor in sensors:
        if sensor.quantity == 'step_acceleration':
            steps.setdefault(sensor.at.get('step'), {})[str(sensor.at['axis'])] = sensor.channel
    return list(steps.values())


def _pose(
    aligned: Mapping[str, Aligned], triad: Mapping[str, str]
) -> tuple[Floats, Floats, Floats] | None:
    """Return corrected readings, bias and rotation of one acceleration sensor."""
    there = [aligned[triad[a]] for a in AXES if a in triad and triad[a] in aligned]
    if not there:
        return None
    n = min(len(a.measured) for a in there)
    measured, simulated = np.full((n, 3), np.nan), np.full((n, 3), np.nan)
    valid = np.ones(n, bool)
    for i, axis in enumerate(AXES):
        if axis in triad and triad[axis] in aligned:
            one = aligned[triad[axis]]
            measured[:, i], simulated[:, i] = one.measured[:n], one.simulated[:n]
            valid &= one.valid[:n]
    simulated = np.where(np.isnan(simulated), 0.0, simulated)
    return remove_sensor_pose(measured, simulated, there[0].rate_hz, valid)


def _align(
    tracks: Mapping[str, Timed],
    columns: Mapping[str, Floats],
    way: Floats,
    sensors: tuple[Sensor, ...],
    travel: Travel,
) -> tuple[dict[str, Aligned], dict[str, tuple[float, ...]]]:
    """Evaluate the run where each sample was taken; take bias and pose out of accelerations."""
    aligned = {}
    for channel, track in tracks.items():
        place, simulated = _simulated(track, columns[channel], way, travel)
        aligned[channel] = Aligned(
            track.values, simulated, track.time_s, place, place, track.valid, track.rate_hz
        )
    pose: dict[str, tuple[float, ...]] = {}
    for triad in _triads(sensors):
        found = _pose(aligned, triad)
        if found is None:
            continue
        corrected, bias, rotation = found
        pose = {'bias_m_s2': tuple(map(float, bias)), 'rotation_deg': tuple(map(float, rotation))}
        for i, axis in enumerate(AXES):
            if axis in triad and triad[axis] in aligned:
                one = aligned[triad[axis]]
                n = len(corrected)
                aligned[triad[axis]] = Aligned(
                    corrected[:, i], one.simulated[:n], one.time_s[:n], one.travel_m[:n],
                    one.place_m[:n], one.valid[:n], one.rate_hz,
                )  # fmt: skip
    return aligned, pose


def _without_pose(
    setting: Setting, columns: Mapping[str, Floats], way: Floats, sensors: tuple[Sensor, ...]
) -> dict[str, Timed]:
    """Return the tracks with bias and rotation of accelerations removed, for the fit."""
    aligned, _ = _align(setting.tracks, columns, way, sensors, setting.travel)
    return {c: Timed(c, a.time_s, a.measured, a.valid, a.rate_hz) for c, a in aligned.items()}


def bands_of(aligned: Aligned, machine: Machine) -> Bands:
    """Return one aligned channel split into the bands that are scored."""
    chain = machine.chain
    travel = np.maximum.accumulate(aligned.travel_m)
    track = Track(
        travel - travel[0],
        aligned.rate_hz,
        chain.n_links * chain.pitch_m,
        chain.pitch_m,
        machine_orders(chain.n_links, chain.pitch_m, machine.roller.diameter_m),
    )
    return split_bands(aligned.measured, aligned.simulated, track, aligned.valid)


def _sides(bands: Mapping[str, Bands], sensors: tuple[Sensor, ...]) -> dict[str, SideScore]:
    """Compare left with right for every link that is measured on both sides."""
    links: dict[object, dict[object, Bands]] = {}
    for sensor in sensors:
        if sensor.quantity == 'link_force' and sensor.channel in bands:
            side = {sensor.at.get('side'): bands[sensor.channel]}
            links.setdefault(sensor.at.get('link'), {}).update(side)
    return {
        f'link {link}': side_scores(pair['left'], pair['right'])
        for link, pair in links.items()
        if {'left', 'right'} <= set(pair) and same_length(pair['left'], pair['right'])
    }


def same_length(left: Bands, right: Bands) -> bool:
    """Tell whether two channels can be taken sample by sample."""
    return len(left.valid) == len(right.valid)
