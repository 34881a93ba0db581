"""Steps of the guide at a rail joint: by the step's own acceleration and by all rollers, then by runs."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from math import log, pi

import numpy as np

from escalator_twin.causes.guide_step import LENGTH_M
from escalator_twin.diagnosis.bumps import Bump, Bumps
from escalator_twin.diagnosis.grids import band_limited
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.regression import score_each
from escalator_twin.diagnosis.scan import as_run
from escalator_twin.diagnosis.search import Search, SIDES, WORTH
from escalator_twin.signals import Floats

RAIL_STEP_M = 0.02
RAIL_WORTH = 2.5  # chi squared by the step's own acceleration from which a place is simulated
RAIL_TRIES = 2
RAIL_APART_M = 0.3  # of two places
RAIL_REACH_M = 0.035  # to either side: what the step's own acceleration leaves open, and a bump of another shape
RAIL_OPEN = 50.0  # from which more shapes are tried: noise, and a survey's error, are far below
RAIL_CLOSE = 0.5  # of the best place's, from which another's shapes are tried as well
TRIAL_M = 1.5e-3
LOW = Bump(TRIAL_M / 3.0, LENGTH_M, is_free=True)
# The shapes of contracts.md, a centimetre of length apart: a roller leaves a longer bump otherwise. Heights
# stand for each other by `bumps.ALIKE`: up to twice the reference, and down to none by the low ones.
RAIL_LENGTHS_M = (0.045, 0.055, 0.065, 0.075)
RAIL_HEIGHTS_M = (1.0e-3, 1.5e-3, 2.1e-3, -1.0e-3, -1.5e-3)
FINER_M = 0.005  # of length, about the best shape
FINER = (0.8, 0.9, 1.0, 1.1, 1.25)  # times its height
LEAST_M = 1e-4  # a tolerance: no effect is lower
HELD = 0.5  # of what a run promises of another height
BAND = 1.25  # of heights one of which is run, to the next
SIDE_CLOSE = 0.8  # of the best side's, from which shapes about another's best are tried as well: as `trial.CLOSE`
SHAPED = 10.0  # times what a bump of one shape explains: the most that another at its place does
ROUND_M = 0.2  # between places all round the loop, each read half of that to either side
ENOUGH = 0.8  # of what is open: what explains so much leaves nothing to seek all round the loop
CHUNK = 128


def rail_steps(search: Search) -> Iterator[Proposal]:
    """Propose steps of the rail: first by the step's own acceleration, then by a run."""
    bumps = Bumps.beside(search, 0.5 * ROUND_M)
    length = bumps.length_m
    places = np.arange(0.0, length, RAIL_STEP_M)
    sizes, gains = _by_step(search, places, length)
    pitch = search.view.observation.frame.pitch_m

    def trial(start: float) -> list[Proposal]:
        size = sizes[round(start / RAIL_STEP_M) % len(places)]
        return _trial(bumps, start, -1.0 if size < 0.0 else 1.0)

    def tried(starts: Sequence[float]) -> list[list[Proposal]]:
        found = [trial(s) for s in starts]
        return _shaped(bumps, _followed(found, trial, pitch, length))

    starts = _starts(places, gains, length)
    trials = tried(starts)
    explained = max((_most(found).gain for found in trials), default=0.0)
    if search.is_open and max(explained, search.least / WORTH) < ENOUGH * search.excess:
        trials += tried(_all_round(bumps, starts))
    for found in _best_apart(trials, length):
        for side in (*SIDES, 'both'):
            yield from _as_run(search, _on(found, side))


def _as_run(search: Search, found: Sequence[Proposal]) -> list[Proposal]:
    """Return the bump that explains most as it is, of the best of every height, and the most promising one.

    A roller leaves its track by a bump of one height and stays on it by one a little lower; what a run says of
    both sides is the sum of what it says of either. What promises most is where a fit begins best, where tolerances
    move what it does by millimetres, unless half of the promise is not held.
    """
    best, at = _most(found), dict[int, Proposal]()
    if best.gain < RAIL_OPEN:
        return [best]
    for one in sorted(found, key=lambda p: -p.gain):
        at.setdefault(_band(one.parameters['height_m']), one)
    some = [one for one in at.values() if one.gain >= RAIL_CLOSE * best.gain]
    ran = as_run(search.stage, search.fitted, some, search.jobs)
    if not ran:
        return [best]
    held = [one for one in ran if one.deviation == best.deviation and one.gain >= HELD * best.gain]
    return [_most(ran), *(one for one in held if one is not _most(ran))]


def _band(height_m: float) -> int:
    """Return a number that heights near each other have in common."""
    way = round(log(max(abs(height_m), LEAST_M) / LEAST_M) / log(BAND))
    return -1 - way if height_m < 0.0 else way


def _by_step(search: Search, places: Floats, length: float) -> tuple[Floats, Floats]:
    """Return what bumps at some places explain of a step's own acceleration, (k,) each.

    Their heights, m, and the chi squared; nothing where no step's is measured.
    """
    sizes, gains = np.zeros(len(places)), np.zeros(len(places))
    at = [
        k
        for k, channel in enumerate(search.view.observation.channels)
        if search.machine.instruments.sensor(channel).at.get('axis') == 'z'
    ]
    if not at:
        return sizes, gains
    fitted, whiten = search.among(at[:1])
    for start in range(0, len(places), CHUNK):
        some = places[start : start + CHUNK]
        columns = sum(_bumps(search, axle, some, length) for axle in (0, 1))
        scores = score_each(fitted, whiten(np.asarray(columns)[:, None, :]))
        gains[start : start + CHUNK] = scores.gain
        sizes[start : start + CHUNK] = scores.size
    return sizes, gains


def _starts(places: Floats, gains: Floats, length: float) -> list[float]:
    """Return the places that are run, by what the step's own acceleration says, m."""
    worth = [k for k in np.argsort(-gains) if gains[k] >= RAIL_WORTH]
    return _first_apart([float(places[k]) for k in worth], length)


def _first_apart(places: Sequence[float], length: float) -> list[float]:
    """Return the first of some places that are apart from those before, m."""
    chosen: list[float] = []
    for place in places:
        if len(chosen) == RAIL_TRIES:
            break
        if all(_apart(place, s, length) >= RAIL_APART_M for s in chosen):
            chosen.append(place)
    return chosen


def _best_apart(trials: list[list[Proposal]], length: float) -> list[list[Proposal]]:
    """Return the best trials, those that led to one place as one."""
    chosen: list[list[Proposal]] = []
    for found in sorted(trials, key=lambda found: -_most(found).gain):
        at = _place(_most(found))
        same = (c for c in chosen if _apart(at, _place(_most(c)), length) <= RAIL_APART_M / 2)
        home = next(same, None)
        if home is None:
            chosen.append(list(found))
        else:
            home += found
    return chosen[:RAIL_TRIES]


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


def _all_round(bumps: Bumps, known: Sequence[float]) -> list[float]:
    """Return the places, m, where low bumps explain most by all rollers that pass them.

    Not those next to places that are known: they are run already.
    A step passes a place once a loop, and slowly it shows little; every roller passes it once a pitch.
    """
    length = bumps.length_m
    count = round(length / ROUND_M)
    runs = [(k * length / count, LOW) for k in range(count)]
    found = sorted(_run(bumps, runs, 0.5 * length / count), key=lambda p: -p.gain)
    worth = [_place(p) for p in found if p.gain >= RAIL_OPEN]
    new = [at for at in worth if all(_apart(at, s, length) >= RAIL_REACH_M for s in known)]
    return _first_apart(new, length)


def _trial(bumps: Bumps, place: float, sign: float) -> list[Proposal]:
    """Run bumps of one length near a place: one as the step's acceleration has it, and a low one."""
    high = Bump(sign * TRIAL_M, LENGTH_M, is_free=True)
    return _run(bumps, [(place, high), (place, LOW)], RAIL_REACH_M)


def _shaped(bumps: Bumps, trials: list[list[Proposal]]) -> list[list[Proposal]]:
    """Return trials with bumps of more shapes where one explains enough."""
    most = max((_most(found).gain for found in trials), default=0.0)
    least = max(RAIL_OPEN, bumps.search.least / SHAPED, RAIL_CLOSE * most)
    return [
        [*found, *_shapes(bumps, found)] if _most(found).gain >= least else found
        for found in trials
    ]


def _shapes(bumps: Bumps, known: Sequence[Proposal]) -> list[Proposal]:
    """Run bumps of many shapes at a place where one explains something, then finer about the best.

    What a bump does is linear in its height only as long as the rollers stay on their track.
    """
    at = _place(_most(known))
    shapes = [Bump(h, wide) for h in RAIL_HEIGHTS_M for wide in RAIL_LENGTHS_M]
    shapes += [Bump(LOW.height_m, wide, is_low=True) for wide in RAIL_LENGTHS_M]
    found = _run(bumps, [(at, shape) for shape in shapes], RAIL_REACH_M)
    best = [_most(_on(found, side)) for side in (*SIDES, 'both')]
    least = SIDE_CLOSE * _most(best).gain
    finer = dict.fromkeys(run for p in best if p.gain >= least for run in _finer(p))
    return found + _run(bumps, list(finer), RAIL_REACH_M)


def _on(found: Sequence[Proposal], side: str) -> list[Proposal]:
    return [p for p in found if p.location['side'] == side]


def _finer(best: Proposal) -> list[tuple[float, Bump]]:
    """Return shapes about one at its place."""
    height, wide = best.parameters['height_m'], best.parameters['length_m']
    return [
        (_place(best), Bump(k * height, wide + way))
        for k in FINER
        for way in (-FINER_M, 0.0, FINER_M)
    ]


def _run(bumps: Bumps, runs: Sequence[tuple[float, Bump]], reach_m: float) -> list[Proposal]:
    """Propose bumps of some shapes at or near some places."""
    with ThreadPoolExecutor(max(1, bumps.search.jobs)) as pool:
        found = pool.map(lambda run: bumps.at(run[0], run[1], reach_m), runs)
        return [proposal for some in found for proposal in some]
