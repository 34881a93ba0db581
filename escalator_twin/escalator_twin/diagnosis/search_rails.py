"""Steps of the guide at a rail joint: by the step's own acceleration, then by runs."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from math import pi

import numpy as np

from escalator_twin.causes.guide_step import LENGTH_M
from escalator_twin.diagnosis.loops import band_limited
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.refine import on_path
from escalator_twin.diagnosis.regression import score_each
from escalator_twin.diagnosis.search import Search, SIDES
from escalator_twin.machine import Deviation
from escalator_twin.signals import Floats

RAIL_STEP_M = 0.02
RAIL_WORTH = 2.5  # chi squared by the step's own acceleration from which a place is simulated
RAIL_TRIES = 2
RAIL_APART_M = 0.3  # of two places
# What the step's own acceleration leaves open, in steps that a ringing chain allows: a third of its wave of 3 cm at
# 14 Hz and 0.4 m/s. Three centimetres apart a bump of 4 cm at 23.99 m was fitted a pitch away, at 0.002 m.
RAIL_SHIFTS_M = (0.0, -0.01, 0.01, -0.02, 0.02, -0.03, 0.03)
RAIL_OPEN = 50.0  # from which more shapes are tried: noise, and a survey's error, are far below
# The shapes of contracts.md, a centimetre of length apart: a roller leaves a longer bump otherwise.
RAIL_LENGTHS_M = (0.045, 0.055, 0.065, 0.075)
RAIL_NEAR_M = (0.0, -0.01, 0.01)  # of the best of these, in every shape
RAIL_FINE_M = (-0.005, 0.005)  # of the best of those
RAIL_CLOSE = 0.5  # of the best place's, from which another's shapes are tried as well
TRIAL_M = 1.5e-3
LOW_M = TRIAL_M / 3.0  # linear, of either sign
SHAPED = 10.0  # times what a bump of one shape explains: the most that another at its place does
RAIL_M = 1.0  # no rail is laid in shorter pieces: at each end of one a good machine has a step of a tolerance
CHUNK = 128


def rail_steps(search: Search) -> Iterator[Proposal]:
    """Propose steps of the rail: first by the step's own acceleration, then by a run."""
    observation, view = search.view.observation, search.view
    at = [
        k
        for k, channel in enumerate(observation.channels)
        if search.machine.instruments.sensor(channel).at.get('axis') == 'z'
    ]
    if not at:
        return
    length = abs(view.responses.base.length_m)
    places = np.arange(0.0, length, RAIL_STEP_M)
    sizes, gains = np.zeros(len(places)), np.zeros(len(places))
    fitted, whiten = search.among(at[:1])
    for start in range(0, len(places), CHUNK):
        some = places[start : start + CHUNK]
        columns = sum(_bumps(search, axle, some, length) for axle in (0, 1))
        scores = score_each(fitted, whiten(np.asarray(columns)[:, None, :]))
        gains[start : start + CHUNK] = scores.gain
        sizes[start : start + CHUNK] = scores.size

    def trial(start: float) -> list[Proposal]:
        size = sizes[round(start / RAIL_STEP_M) % len(places)]
        return _rail_trial(search, start, -1.0 if size < 0.0 else 1.0)

    starts = _starts(places, gains, length)
    trials = _followed([trial(s) for s in starts], trial, observation.frame.pitch_m, length)
    if not trials:
        return
    most = max(_most(found).gain for found in trials)
    least = max(RAIL_OPEN, search.least / SHAPED, RAIL_CLOSE * most)
    for found in trials:
        if _most(found).gain >= least:
            found += _rail_shapes(search, found)
    trials.sort(key=lambda found: -_most(found).gain)
    for found in trials[:RAIL_TRIES]:
        for side in (*SIDES, 'both'):
            yield _most([p for p in found if p.location['side'] == side])


def _starts(places: Floats, gains: Floats, length: float) -> list[float]:
    """Return the places that are run, by what the step's own acceleration says, m."""
    starts: list[float] = []
    for k in np.argsort(-gains):
        if len(starts) == RAIL_TRIES or gains[k] < RAIL_WORTH:
            break
        if all(_apart(float(places[k]), s, length) >= RAIL_APART_M for s in starts):
            starts.append(float(places[k]))
    return starts


def _followed(
    trials: list[list[Proposal]],
    trial: Callable[[float], list[Proposal]],
    pitch_m: float,
    length: float,
) -> list[list[Proposal]]:
    """Return trials at some places, and a pitch beside the best of them as long as that leads on.

    A step's two axles pass a bump one after the other, and the chain takes it to other links: a pitch off
    looks half as well, or to the step alone better.
    """
    trials = list(trials)
    while trials:
        best = _most([_most(found) for found in trials])
        beside = [float((_place(best) + way) % length) for way in (-pitch_m, pitch_m)]
        new = [
            s
            for s in beside
            if all(_apart(s, _place(found[0]), length) > RAIL_APART_M / 2 for found in trials)
        ]
        if not new:
            break
        trials += [trial(s) for s in new]
    return trials


def _place(proposal: Proposal) -> float:
    return float(str(proposal.location['s_m']))


def _apart(one: float, other: float, length: float) -> float:
    """Return the distance of two places round the loop, m."""
    return abs((one - other + 0.5 * length) % length - 0.5 * length)


def _most(found: Sequence[Proposal]) -> Proposal:
    return max(found, key=lambda p: p.gain)


def _bumps(search: Search, axle: int, places: Floats, length: float) -> np.ndarray:
    """Return the acceleration of a step by bumps of 1 m under one roller, (n, k)."""
    frame = search.view.observation.frame
    way = search.view.place_of(axle) % length
    wave = 2.0 * pi / LENGTH_M
    raw = np.zeros((len(way), len(places)), np.float32)
    for k, place in enumerate(places):
        away = (way - place + 0.5 * length) % length - 0.5 * length
        inside = np.abs(away) < 0.5 * LENGTH_M
        # h'' v^2, a quarter of it: one roller of four carries the middle of the step
        bend = -0.5 * wave**2 * np.cos(wave * away[inside])
        raw[inside, k] = 0.25 * frame.speed_m_s**2 * bend
    return band_limited(raw, frame.rate_hz)


def _rail_trial(search: Search, place: float, sign: float) -> list[Proposal]:
    """Run bumps of one length at a place and beside it."""
    return _all_bumped(search, place, RAIL_SHIFTS_M, (LENGTH_M,), (sign * TRIAL_M, LOW_M))


def _rail_shapes(search: Search, known: Sequence[Proposal]) -> list[Proposal]:
    """Run bumps of many shapes at a place where one explains something.

    What a bump does is linear in its height only as long as the rollers stay on their track.
    """
    shapes = RAIL_LENGTHS_M, (TRIAL_M, -TRIAL_M, LOW_M)
    found = _all_bumped(search, _place(_most(known)), RAIL_NEAR_M, *shapes)
    return found + _all_bumped(search, _place(_most(found)), RAIL_FINE_M, *shapes)


def _all_bumped(
    search: Search,
    begin: float,
    shifts: Sequence[float],
    lengths: Sequence[float],
    heights: Sequence[float],
) -> list[Proposal]:
    """Propose bumps of some shapes near a place, those at the place itself first."""
    length = abs(search.view.responses.base.length_m)
    path_m = search.stage.machine_length

    def bumped(shape: tuple[float, float, float]) -> list[Proposal]:
        shift, wide, height = shape
        return _bumped(search, on_path((begin + shift) % length, path_m), height, wide)

    with ThreadPoolExecutor(max(1, search.jobs)) as pool:
        ran = pool.map(bumped, product(shifts, lengths, heights))
        return [proposal for some in ran for proposal in some]


def _bumped(search: Search, at: float, height: float, wide: float) -> list[Proposal]:
    """Propose a bump of one shape at one place, on the left, on the right and on both sides."""
    length = abs(search.view.responses.base.length_m)
    count, joints = 3 * round(length / 0.25), 2 * round(length / RAIL_M)
    location: dict[str, object] = {'s_m': at, 'side': 'left'}
    deviation = Deviation('guide_step', {'height_m': height, 'length_m': wide}, location)
    left = (search.stage.run((deviation,)) - search.model) / height
    right = mirrored(search, left)
    columns = np.stack([left, right, left + right], axis=2)
    score = score_each(search.fitted, search.whiten(columns))
    return [
        Proposal(
            'guide_step', {'s_m': at, 'side': side},
            {'height_m': float(score.size[k]), 'length_m': wide}, float(score.gain[k]),
            {'height_m': float(score.sd[k])}, count, ('height_m', '@s_m', 'length_m'), draws=joints,
        )
        for k, side in enumerate((*SIDES, 'both'))
    ]  # fmt: skip


def mirrored(search: Search, columns: Floats) -> Floats:
    """Return a response on the channels of the other side, (n, c)."""
    sensors = [
        search.machine.instruments.sensor(channel) for channel in search.view.observation.channels
    ]
    other = np.array(columns)
    for k, sensor in enumerate(sensors):
        if sensor.at.get('axis') == 'y':
            other[:, k] = -columns[:, k]
        if 'side' not in sensor.at:
            continue
        twin = {**sensor.at, 'side': SIDES[1 - SIDES.index(str(sensor.at['side']))]}
        for j, candidate in enumerate(sensors):
            if candidate.quantity == sensor.quantity and candidate.at == twin:
                other[:, k] = columns[:, j]
    return other
