"""One step of a fit of effects and tolerances together."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from math import inf
from typing import TypeVar

import numpy as np

from escalator_twin.diagnosis.context import Beside, beside, Context, Own, with_own_tolerances
from escalator_twin.diagnosis.floor import SHAKING
from escalator_twin.diagnosis.knobs import RACKING
from escalator_twin.diagnosis.loops import LOCAL
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.refine import changed, jacobian_of, moved, slope_of
from escalator_twin.diagnosis.regression import fit, Fitted, inner_products, inverse
from escalator_twin.diagnosis.rest import with_rest
from escalator_twin.diagnosis.stage import LARGEST
from escalator_twin.diagnosis.tuning import coarse_to_fine, ROUNDS
from escalator_twin.machine import Deviation
from escalator_twin.signals import Floats

SHARES = (1.0, 0.4, 0.15)
STRETCH, FARTHEST = 2.5, 7.0  # of a step that explains more
FURTHER = 1.6  # times a step, from where the parabola through its ends has its least: stretch it
WHOLE_STEP = 1.0  # standard deviations
LEAST_WAY = 0.05  # standard deviations: a shorter step says nothing of what tolerances do

Free = Callable[[Beside], Beside]
One = TypeVar('One')


@dataclass(frozen=True)
class JointFit:
    """What stays the same over the steps of a fit.

    Attributes
    ----------
    context : Context
        What the tolerances do.
    known : tuple of Deviation
        More effects of the machine, whose numbers stay.
    free : callable or None
        Frees the nuisance that effects of the measurement stand for.
    """

    context: Context
    known: tuple[Deviation, ...]
    free: Free | None

    def deviations(self, effects: Sequence[Proposal]) -> tuple[Deviation, ...]:
        return (*self.known, *(e.deviation for e in effects))

    def taken_anew(
        self, effects: Sequence[Proposal], turned: Mapping[str, float], jobs: int
    ) -> 'JointFit':
        """Return the same where the tolerances act as they do in this machine."""
        deviations = self.deviations(effects)
        # what the rail does is no other where every effect is one link's, axle's or step's
        is_other = any(d.cause not in LOCAL for d in deviations)
        context = with_own_tolerances(self.context, deviations, jobs, turned, with_rails=is_other)
        return replace(self, context=context)

    def taken_whole(self, place: Beside, effects: Sequence[Proposal], jobs: int) -> 'JointFit':
        """Return the same where each tolerance's effect is run with the effects themselves."""
        stage = replace(place.stage, machine=self.context.machine)
        deviations = self.deviations(effects)
        stood_for = {e.nuisance for e in effects}
        names = [
            knob.name
            for knob in stage.knobs
            if knob.name not in stood_for and knob.name not in self.context.weak
        ]

        def column(name: str) -> np.ndarray:
            z = stage.turned.get(name, 0.0)
            way = -WHOLE_STEP if z > 0.0 else WHOLE_STEP
            turned = replace(stage, turned={**stage.turned, name: z + way})
            change = (turned.run(deviations) - place.model) / way
            return (change * stage.quiet).astype(np.float32)

        with ThreadPoolExecutor(max(1, jobs)) as pool:
            columns = dict(zip(names, pool.map(column, names), strict=True))
        own = Own(stage.observation.index, columns)
        return replace(self, context=replace(self.context, own=own))

    def by_secant(
        self, before: Beside, effects: Sequence[Proposal], turned: Mapping[str, float]
    ) -> 'JointFit':
        """Return the same with what each tolerance does corrected by what a step of all of them did.

        Broyden's rank-one correction (Math. Comp. 19, 1965): along the step the effect is as run, across it as
        it was. It costs one run, where `taken_whole` costs one of every tolerance.

        Parameters
        ----------
        before : Beside
            The machine with the effects, where the step began.
        effects : sequence of Proposal
            There.
        turned : mapping of tolerance to float
            Where it ended, standard deviations.
        """
        own = self.context.own
        if own is None:
            return self
        stage = replace(before.stage, machine=self.context.machine)
        index = stage.observation.index
        columns = own.at(index)
        way = {k: turned.get(k, 0.0) - stage.turned.get(k, 0.0) for k in columns}
        square = sum(z * z for z in way.values())
        if square < LEAST_WAY**2:
            return self
        run = replace(stage, turned={**stage.turned, **turned}).run(self.deviations(effects))
        rest = ((run - before.model) * stage.quiet).astype(np.float32)
        for name, z in way.items():
            rest -= z * columns[name]
        again = {k: column + (way[k] / square) * rest for k, column in columns.items()}
        return replace(self, context=replace(self.context, own=Own(index, again)))

    def beside(self, effects: Sequence[Proposal], turned: Mapping[str, float]) -> Beside:
        place = beside(self.context, self.deviations(effects), steps=0, turned=turned)
        return place if self.free is None else self.free(place)

    def tuned(
        self,
        effects: Sequence[Proposal],
        held: Collection[str],
        jobs: int,
        rounds: int = ROUNDS,
        most: float = inf,
    ) -> tuple[dict[str, float], float]:
        """Return the tolerances that the machine with the effects fits best with, from none.

        ``rounds``, ``most`` and what is returned: see `coarse_to_fine`.
        """
        plain, nominal = self, self.context.nominal
        if nominal is not None:
            responses = replace(self.context.responses, knobs=nominal.responses.knobs)
            plain = replace(self, context=replace(self.context, responses=responses, own=None))
        if any(d.cause not in LOCAL for d in self.deviations(effects)):
            plain = plain.taken_anew(effects, {}, jobs)  # the rail acts as in that machine too
        place = plain.beside(effects, {})
        return coarse_to_fine(
            plain.context, place, self.deviations(effects), jobs, held, self.free, rounds, most
        )

    def columns(self, place: Beside, effects: Sequence[Proposal], jobs: int = 1) -> np.ndarray:
        """Return the whitened change by every number of every effect, and by ``sided``, (m, p)."""
        found = []
        for k, effect in enumerate(effects):
            if not effect.fitted:
                continue
            others = [e.deviation for j, e in enumerate(effects) if j != k]
            bare = replace(place.stage, machine=self.context.machine)
            bare = bare.extended((*self.known, *others))
            found.append(jacobian_of(bare, None, place.model, effect, jobs=jobs))
        for name in self.sided(place, effects):
            turned = {**place.stage.turned, name: place.stage.turned.get(name, 0.0) + 1.0}
            bare = replace(place.stage, machine=self.context.machine, turned=turned)
            change = bare.run(self.deviations(effects)) - place.model
            found.append(place.stage.columns(change[:, :, None], effects[0].cause))
        if not found:
            return np.empty((len(place.fitted.white), 0), np.float32)
        return np.concatenate(found, axis=1)

    def step(
        self, place: Beside, effects: tuple[Proposal, ...], white: np.ndarray, jobs: int = 1
    ) -> tuple[Beside, tuple[Proposal, ...]] | None:
        """Take the step of Gauss and Newton, or a part of it; None where neither explains more.

        Where a whole step does not, parts of it are run ``jobs`` at a time: the first that does is taken, however
        many were run.
        """
        stage = place.stage
        fitted, kept = _free(place, effects)
        right, gram = self.products(place, effects, white)
        delta = inverse(gram) @ right
        rest = fit(fitted.white - white @ delta.astype(np.float32), fitted.columns, fitted.offset)
        sizes = np.zeros(len(stage.nuisance.names))
        sizes[kept] = rest.sizes
        names = {knob.name for knob in stage.knobs} - {e.nuisance for e in effects}
        sided = self.sided(place, effects)
        more = dict(zip(sided, delta[len(delta) - len(sided) :], strict=True))

        def tried(share: float, along: float = 1.0) -> tuple[Beside, tuple[Proposal, ...]]:
            trial = tuple(moved_all(effects, share * delta, stage.machine_length))
            turned = {
                name: float(np.clip(offset + along * share * size, -LARGEST, LARGEST))
                for name, offset, size in zip(
                    stage.nuisance.names, stage.offset, sizes, strict=True
                )
                if name in names
            }
            for name, way in more.items():
                z = stage.turned.get(name, 0.0) + along * share * float(way)
                turned[name] = float(np.clip(z, -LARGEST, LARGEST))
            return self.beside(trial, turned), trial

        best, start = None, judged(place, effects)
        value, share = start, SHARES[-1]
        # what tolerances do bends within a part of a standard deviation: at last without them
        ways = [(s, 1.0) for s in SHARES] + [(s, 0.0) for s in SHARES[:-1]]
        for way, again in first_few(tried, ways, jobs):
            if judged(again[0], effects) < start:
                if way[1] == 0.0:
                    return again
                best, value, share = again, judged(again[0], effects), way[0]
                break
        # fine patterns that a change shifts make its column larger than what it explains: on and on
        bend = value - start + 2.0 * share * float(right @ delta)  # times the share's square
        if bend > 0.0 and share * float(right @ delta) < FURTHER * bend:
            return best
        share = STRETCH
        while best is not None and share <= FARTHEST:
            again = tried(share)
            if judged(again[0], effects) >= value:
                break
            best, value = again, judged(again[0], effects)
            share *= STRETCH
        return best

    def sided(self, place: Beside, effects: Sequence[Proposal]) -> tuple[str, ...]:
        """Return the tolerances that only show beside these effects, and are not columns yet."""
        is_one_sided = any(e.cause in LOCAL and 'side' in e.location for e in effects)
        known = {knob.name for knob in place.stage.knobs}
        if not is_one_sided or RACKING not in known or self.context.own is not None:
            return ()
        return (RACKING,)

    def products(
        self, place: Beside, effects: Sequence[Proposal], white: np.ndarray
    ) -> tuple[Floats, Floats]:
        """Return right side and matrix of the normal equations, tolerances with their priors."""
        fitted, _ = _free(place, effects)
        right, gram = inner_products(fitted, white)
        sided = self.sided(place, effects)
        for k, name in enumerate(sided, len(right) - len(sided)):
            right[k] -= place.stage.turned.get(name, 0.0)
            gram[k, k] += 1.0
        return right, gram

    def spreads(
        self, place: Beside, effects: tuple[Proposal, ...], white: np.ndarray
    ) -> tuple[dict[str, float], ...]:
        """Return one standard deviation of every number, beside all others and the nuisance."""
        _, gram = self.products(place, effects, white)
        covariance = inverse(gram)
        found, first = [], 0
        for effect in effects:
            spread = {}
            for i, key in enumerate(effect.fitted, first):
                variance = max(float(covariance[i, i]), 0.0)
                spread[key] = abs(slope_of(effect, key)) * variance**0.5
            found.append(with_rest(self.context, spread))
            first += len(effect.fitted)
        return tuple(found)


def first_few(
    work: Callable[..., One], ways: Sequence[tuple[float, ...]], jobs: int
) -> Iterator[tuple[tuple[float, ...], One]]:
    """Do the first of some ways, then the others, some at a time, as long as they are asked for."""
    yield ways[0], work(*ways[0])
    with ThreadPoolExecutor(max(1, jobs)) as pool:
        for begin in range(1, len(ways), max(1, jobs)):
            some = ways[begin : begin + max(1, jobs)]
            yield from zip(some, pool.map(lambda way: work(*way), some), strict=True)


def judged(place: Beside, effects: Sequence[Proposal]) -> float:
    """Return what a step is judged by: all channels that one of the effects acts on."""
    return place.stage.judged(place.fitted, shaking_of(effects))


def shaking_of(effects: Sequence[Proposal]) -> str | None:
    """Return the cause of the first effect that acts on channels which rattling shakes, too."""
    return next((e.cause for e in effects if e.cause in SHAKING), None)


def _free(place: Beside, effects: Sequence[Proposal]) -> tuple[Fitted, list[int]]:
    """Return the fit without the tolerances that effects stand for, and which columns it has."""
    names = place.stage.nuisance.names
    fitted, kept = place.fitted, list(range(len(names)))
    # what is sought afar may be of the cause of a known effect: both stand for one tolerance then
    for name in dict.fromkeys(str(effect.nuisance) for effect in effects):
        if name in names:
            index = kept.index(names.index(name))
            fitted = fitted.without(index)
            kept.pop(index)
    return fitted, kept


def moved_all(effects: Sequence[Proposal], delta: Floats, length_m: float) -> list[Proposal]:
    """Return the effects with their numbers moved."""
    found, first = [], 0
    for effect in effects:
        part = delta[first : first + len(effect.fitted)]
        first += len(effect.fitted)
        values = {
            key: moved(effect, key, float(d)) for key, d in zip(effect.fitted, part, strict=True)
        }
        found.append(changed(effect, values, length_m))
    return found
