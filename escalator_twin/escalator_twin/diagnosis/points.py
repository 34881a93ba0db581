"""Several recordings beside one machine: where a fit of all of them stands."""

from collections.abc import Callable, Collection, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np

from escalator_twin.diagnosis.context import Beside, Context, with_own_tolerances
from escalator_twin.diagnosis.free import any_local
from escalator_twin.diagnosis.joint import Free, JointFit, shaking_of
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.regression import Fitted
from escalator_twin.diagnosis.unknowns import mean_of, Name, of_one, of_recording

One = TypeVar('One')
Beginning = tuple[tuple[Proposal, ...], Mapping[Name, float]]  # effects, tolerances


@dataclass(frozen=True)
class Part:
    """One recording in the fit.

    Attributes
    ----------
    context : Context
        With what tolerances and rail do to the machine as described.
    effects : tuple of Proposal
        That act on the machine as a whole, in all recordings the same.
    own : tuple of Proposal
        More of the machine, whose numbers stay: of one link, axle or step, waves of the drive.
    free : callable or None
        Frees the nuisance that effects of the measurement stand for.
    turned : mapping of tolerance to float
        Where the recording by itself has the tolerances, standard deviations; empty where that is not known.
    sized : tuple of Proposal
        The effects as the recording by itself has them; empty where that is not known, or it has not all of them.
    """

    context: Context
    effects: tuple[Proposal, ...]
    own: tuple[Proposal, ...] = ()
    free: Free | None = None
    turned: Mapping[str, float] = field(default_factory=dict)
    sized: tuple[Proposal, ...] = ()


@dataclass(frozen=True)
class Point:
    """All recordings beside one machine.

    Attributes
    ----------
    fits : tuple of JointFit
        Of each recording, with what the tolerances do.
    own : tuple of tuple of Proposal
        Effects of each recording, whose numbers stay.
    effects : tuple of Proposal
    turned : mapping of name to float
        Tolerances, standard deviations.
    places : tuple of Beside
        The machine as each recording ran it; empty before `Runs.run`.
    levels : tuple of float
        Chi squared of each, by the channels that the effects act on.
    is_whole : bool
        What tolerances do was run with the effects of single links in the machine.
    since : Point or None
        Where it was, if not here.
    """

    fits: tuple[JointFit, ...]
    own: tuple[tuple[Proposal, ...], ...]
    effects: tuple[Proposal, ...]
    turned: Mapping[Name, float]
    places: tuple[Beside, ...] = ()
    levels: tuple[float, ...] = ()
    is_whole: bool = False
    since: 'Point | None' = None

    @property
    def level(self) -> float:
        """Chi squared of all recordings, and the tolerances' own once."""
        return sum(self.levels) + squares(self.turned)

    @property
    def is_local(self) -> bool:
        """Tell whether an effect of a single link, axle or step is beside the shared ones."""
        return any(any_local(own) for own in self.own)

    def of(self, r: int) -> tuple[Proposal, ...]:
        """Return all effects of a recording."""
        return (*self.effects, *self.own[r])

    def turned_of(self, r: int) -> dict[str, float]:
        """Return the tolerances as a recording has them."""
        return of_recording(self.turned, r)


@dataclass(frozen=True)
class Runs:
    """Runs a machine as all recordings ran it, some at a time."""

    pool: ThreadPoolExecutor

    def each(self, do: Callable[..., One], *rows: Sequence[Any]) -> list[One]:
        return list(self.pool.map(do, *rows))

    def start(self, parts: Sequence[Part]) -> Point:
        """Return all recordings beside the effects, no tolerance turned."""
        fits = tuple(self.each(_with_rails, parts))
        own = tuple(part.own for part in parts)
        return self.run(Point(fits, own, parts[0].effects, {}))

    def run(self, point: Point) -> Point:
        """Run every recording's machine, and align and fit what is its own."""

        def beside(r: int) -> tuple[Beside, float]:
            place = point.fits[r].beside(point.of(r), point.turned_of(r))
            fitted, _ = own_fit(place, point.effects)
            return place, place.stage.judged(fitted, shaking_of(point.effects))

        rows = self.each(beside, range(len(point.fits)))
        places, levels = zip(*rows, strict=True)
        return replace(point, places=places, levels=levels)

    def taken_anew(self, point: Point) -> Point:
        """Return a point that was run with what every tolerance does there.

        What a longer link does hangs on the contacts' stiffness, so that beside effects of single links these are
        in the runs: without them sixteen recordings told a chain of 0.150 mm a link as 0.174 mm, with them as
        0.165 mm (seed 251106, development). Such runs take a machine's whole length: once they were made, what
        a step did corrects what they told.
        """
        if point.is_whole and point.since is None:
            return point
        do = (_by_secant if point.is_whole else _whole) if point.is_local else _anew
        fits = tuple(self.each(do, range(len(point.fits)), [point] * len(point.fits)))
        return self.run(replace(point, fits=fits, is_whole=point.is_local, since=None))


def beginnings(parts: Sequence[Part], without: Collection[str]) -> list[Beginning]:
    """Return where a fit may begin: with the mean of what recordings by themselves have, and with what each has.

    Of those that have all effects: beside fewer, tolerances had been turned for want of the others (a roller's alone,
    beside which a resistance and a landing were missing, took the mean from a chi squared of some 50000 to
    53500; seed 251144, development). ``without``: see `mean_of`.
    """
    whole = [r for r, part in enumerate(parts) if part.sized and part.turned]
    turned = [part.turned if not whole or part.sized else {} for part in parts]
    mean = mean_of(turned, without)
    found: list[Beginning] = [(parts[0].effects, mean)] if mean else []
    if len(whole) > 1:
        found += [(parts[r].sized, of_one(turned, r, without)) for r in whole]
    return found


def moved_from(point: Point, effects: tuple[Proposal, ...], turned: Mapping[Name, float]) -> Point:
    """Return another machine, not run yet, that knows what tolerances do from where it came from."""
    return replace(
        point,
        effects=effects,
        turned=turned,
        since=point.since or point if point.is_whole else None,
    )


def _anew(r: int, point: Point) -> JointFit:
    one = point.fits[r]
    context = with_own_tolerances(
        one.context,
        one.deviations(point.of(r)),
        turned=point.turned_of(r),
        with_rails=False,
    )
    return replace(one, context=context)


def _whole(r: int, point: Point) -> JointFit:
    return point.fits[r].taken_whole(point.places[r], point.of(r), 1)


def _by_secant(r: int, point: Point) -> JointFit:
    since = point.since or point
    return point.fits[r].by_secant(since.places[r], since.of(r), point.turned_of(r))


def _with_rails(part: Part) -> JointFit:
    """Return a recording's fit with what tolerances and rail do beside its effects."""
    deviations = tuple(e.deviation for e in (*part.effects, *part.own))
    return JointFit(with_own_tolerances(part.context, deviations), (), part.free)


def squares(turned: Mapping[Name, float]) -> float:
    return sum(z * z for z in turned.values())


def own_fit(place: Beside, effects: Sequence[Proposal]) -> tuple[Fitted, list[int]]:
    """Return the fit with what is the recording's own alone, and which columns are shared tolerances'."""
    knobs = {knob.name for knob in place.stage.knobs}
    stood_for = {e.nuisance for e in effects}
    names = place.stage.nuisance.names
    own = [k for k, name in enumerate(names) if name not in knobs]
    shared = [k for k, name in enumerate(names) if name in knobs and name not in stood_for]
    return place.fitted.keeping(np.array(own)), shared
