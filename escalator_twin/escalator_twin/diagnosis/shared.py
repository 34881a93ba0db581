"""Fit effects of a machine and its tolerances to several of its recordings together.

Each recording by itself is fitted beside tolerances of its own, and where they make up for a part of an effect
every one is off by another part: one chain of 0.15 mm a link was told as 0.127 to 0.218 mm, each to 5 %. But the
tolerances are one machine's. Here they are turned in all recordings alike, and so is every size of an effect
that does not hang on a recording; the rail's short waves, alignment, course, clocks and instruments stay each recording's
own, and so do the tolerances of what was set for it.

A step is that of Gauss and Newton on the sum of all recordings' chi squared, with what is a recording's own
projected out (variable projection: Golub and Pereyra, SIAM J. Numer. Anal. 10, 1973).
"""

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from escalator_twin.diagnosis.context import Beside
from escalator_twin.diagnosis.descent import KICKS, WORTH_A_ROUND
from escalator_twin.diagnosis.joint import moved_all, shaking_of
from escalator_twin.diagnosis.loops import LOCAL
from escalator_twin.diagnosis.normals import jackknife, Normal, solve
from escalator_twin.diagnosis.points import (
    Beginning,
    beginnings,
    moved_from,
    own_fit,
    Part,
    Point,
    Runs,
    squares,
)
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.refine import slope_of
from escalator_twin.diagnosis.regression import Fitted, inner_products, swapped
from escalator_twin.diagnosis.stage import LARGEST, Stage
from escalator_twin.diagnosis.unknowns import EFFECT, Name, name_of, of_recording
from escalator_twin.errors import EscalatorError

MOST_STEPS = 5  # of Gauss and Newton, before a far turn and after: time
SHARES = (1.0, 0.4, 0.15)  # of a step that are tried
SETTLED = 3.0  # chi squared: a step that gains less is the last one
# What has a place of its own: what a rail's step does hangs on the short waves beside it, which each recording
# tells in its own way. A frame bounces as one in all of them, and what one speed says of its frequency
# another one says of its mass.
PLACED = LOCAL | {'guide_step'}


@dataclass(frozen=True)
class Shared:
    """Effects and tolerances that fit several recordings together.

    Attributes
    ----------
    effects : tuple of Proposal
        The shared ones, with the fitted numbers.
    turned : mapping of tolerance to float
        Standard deviations, in all recordings alike.
    spread : tuple of mapping of parameter to float
        Of each effect: by how much its numbers move as each recording in turn is left out (jackknife).
    levels : tuple of float
        Chi squared of every recording, in its quiet channels.
    """

    effects: tuple[Proposal, ...]
    turned: Mapping[str, float]
    spread: tuple[dict[str, float], ...]
    levels: tuple[float, ...]


def is_shared(effect: Proposal) -> bool:
    """Tell whether an effect has one size in all recordings, and acts on the machine as a whole."""
    return effect.cause not in PLACED and bool(effect.fitted)


@dataclass(frozen=True)
class _Line:
    """One recording's chi squared about a point, to first order in the unknowns."""

    stage: Stage  # lean: on which more tolerances are turned at little cost
    fitted: Fitted  # beside what is the recording's own
    columns: np.ndarray  # (m, k) float32, whitened: what every unknown does
    names: tuple[Name, ...]

    def normal(self, fitted: Fitted) -> Normal:
        right, gram = inner_products(fitted, self.columns)
        return Normal(self.names, right, gram)


def fit_together(parts: Sequence[Part], jobs: int = 1, rounds: int = len(KICKS)) -> Shared:
    """Fit the shared effects and the tolerances to all recordings.

    Parameters
    ----------
    parts : sequence of Part
    jobs : int
        Recordings at a time.
    rounds : int
        In which a tolerance is turned far, to leave a hollow.

    Raises
    ------
    EscalatorError
        Where a machine cannot be run.
    """
    with ThreadPoolExecutor(max(1, jobs)) as pool:
        return _Fit(pool).found(parts, rounds)


@dataclass(frozen=True)
class _Fit(Runs):
    """What stays the same over the steps."""

    def found(self, parts: Sequence[Part], rounds: int) -> Shared:
        start = self.start(parts)
        stood_for = {str(e.nuisance) for r in range(len(parts)) for e in start.of(r)}
        point, lines = self.begun(start, beginnings(parts, stood_for))
        for kick in KICKS[:rounds]:
            turned = self.kicked(point, lines, kick)
            if turned is None:
                break
            # so far off, what tolerances do is run again, after a first step by what it was
            start = replace(point, turned=turned, is_whole=False, since=None)
            other, others = self.descend(self.run(start))
            if other.level < point.level:
                point, lines = other, others
        spread = jackknife([line.normal(line.fitted) for line in lines], point.turned)
        return Shared(
            point.effects,
            {name[0]: z for name, z in point.turned.items() if len(name) == 1},
            tuple(
                {key: abs(slope_of(e, key)) * spread[EFFECT, str(k), key] for key in e.fitted}
                for k, e in enumerate(point.effects)
            ),
            tuple(_quiet_level(place, point.effects) for place in point.places),
        )

    def begun(self, point: Point, beginnings: Sequence[Beginning]) -> tuple[Point, list[_Line]]:
        """Step down from no tolerance, or from where the searches lead if a first step comes lower from there.

        Of several such beginnings, from the one that fits all recordings best as it is.
        """
        first = [self.descend(point, most=1)]
        there = []
        for effects, turned in beginnings:
            # a mean was not run yet, nor what one recording has beside another
            with suppress(EscalatorError):
                there.append(self.run(replace(point, effects=effects, turned=turned)))
        if there:
            with suppress(EscalatorError):
                nearest = min(there, key=lambda start: start.level)
                first.append(self.descend(self.taken_anew(nearest), most=1))
        point, _ = min(first, key=lambda row: row[0].level)
        return self.descend(point, MOST_STEPS - 1, is_anew=False)

    def descend(
        self, point: Point, most: int = MOST_STEPS, is_anew: bool = True
    ) -> tuple[Point, list[_Line]]:
        """Step down by slopes; return where that ends, and what the unknowns do about there.

        ``is_anew``: what every tolerance does was taken where the first step begins.
        """
        lines: list[_Line] = []
        for k in range(most):
            if k or not is_anew:
                point = self.taken_anew(point)
            lines = self.each(_line, range(len(point.places)), [point] * len(point.places))
            trial = self.step(point, lines)
            if trial is None:
                break
            gained, point = point.level - trial.level, trial
            if gained < SETTLED:
                break
        return point, lines

    def step(self, point: Point, lines: Sequence[_Line]) -> Point | None:
        """Take the step of Gauss and Newton, or a part of it; None where none explains more."""
        normals = [line.normal(line.fitted) for line in lines]
        delta, _ = solve(normals, point.turned)
        for share in SHARES:
            way = {name: share * by for name, by in delta.items()}
            effects, turned = _moved(point, way), _turned(point.turned, way)
            trial = self.run(moved_from(point, effects, turned))
            if trial.level < point.level:
                return trial
        return None

    def kicked(self, point: Point, lines: Sequence[_Line], by: float) -> dict[Name, float] | None:
        """Return the tolerances with that one turned far which then explains most; None without gain.

        All else is taken along by the slopes of where it was.
        """
        names = sorted({name for line in lines for name in line.names if len(name) == 1})
        ways: list[dict[Name, float]] = [
            {name: point.turned.get(name, 0.0) + z} for name in names for z in (-by, by)
        ]
        ways = [way for way in ways if all(abs(z) <= LARGEST for z in way.values())]

        def level(way: Mapping[Name, float]) -> float:
            turned: dict[Name, float] = {**point.turned, **way}
            total, normals = squares(turned), []
            for r, line in enumerate(lines):
                fitted = _trial(line, of_recording(turned, r))
                total += line.stage.judged(fitted, shaking_of(point.effects))
                normals.append(line.normal(fitted))
            return total - solve(normals, turned)[1]

        levels = self.each(level, ways)
        best = int(np.argmin(levels))
        if levels[best] > point.level - WORTH_A_ROUND:
            return None
        return {**point.turned, **ways[best]}


def _quiet_level(place: Beside, effects: Sequence[Proposal]) -> float:
    return place.stage.judged(own_fit(place, effects)[0])


def _line(r: int, point: Point) -> _Line:
    fit_one, place, effects = point.fits[r], point.places[r], point.of(r)
    fitted, at = own_fit(place, point.effects)
    sized = (*point.effects, *(replace(e, fitted=()) for e in point.own[r]))
    columns = fit_one.columns(place, sized)
    sided = fit_one.sided(place, effects)
    at = [k for k in at if place.stage.nuisance.names[k] not in sided]
    names = [
        *((EFFECT, str(k), key) for k, e in enumerate(point.effects) for key in e.fitted),
        *(name_of(name, r) for name in sided),
        *(name_of(place.stage.nuisance.names[k], r) for k in at),
    ]
    white = np.concatenate([columns, place.fitted.columns[:, at]], axis=1)
    return _Line(place.stage.lean(place.model), fitted, white, tuple(names))


def _trial(line: _Line, turned: Mapping[str, float]) -> Fitted:
    """Fit what a recording leaves beside a machine with its tolerances turned otherwise."""
    stage = replace(line.stage, turned=dict(turned))
    model = stage.run()
    at, others = stage.shifts(model)
    names = stage.nuisance.names
    knobs = {knob.name for knob in stage.knobs}
    own = [k for k, name in enumerate(names) if name not in knobs]
    places = [own.index(k) for k in at]
    return swapped(line.fitted, stage.white(model), places, others, line.fitted.offset)


def _moved(point: Point, delta: Mapping[Name, float]) -> tuple[Proposal, ...]:
    by = [delta[EFFECT, str(k), key] for k, e in enumerate(point.effects) for key in e.fitted]
    length = point.places[0].stage.machine_length
    return tuple(moved_all(point.effects, np.array(by), length))


def _turned(turned: Mapping[Name, float], delta: Mapping[Name, float]) -> dict[Name, float]:
    ways = {name: by for name, by in delta.items() if name[0] != EFFECT}
    return {
        name: float(np.clip(turned.get(name, 0.0) + by, -LARGEST, LARGEST))
        for name, by in ways.items()
    }
