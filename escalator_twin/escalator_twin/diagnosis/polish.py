"""Fit effects and tolerances together, with the twin run at every step.

An effect and a tolerance may do nearly the same: dry friction and damping of the carriage, its
spring and the preload. Fitted in turns they creep along the valley between them; together they
take it in a few steps.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from escalator_twin.diagnosis.context import (
    Beside,
    beside,
    Context,
    FAR_TURNED,
    with_own_tolerances,
)
from escalator_twin.diagnosis.floor import SHAKING
from escalator_twin.diagnosis.loops import LOCAL
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.refine import changed, jacobian_of, moved, slope_of
from escalator_twin.diagnosis.regression import fit, Fitted, inner_products, inverse
from escalator_twin.diagnosis.stage import LARGEST
from escalator_twin.machine import Deviation
from escalator_twin.signals import Floats

# A tolerance that does nothing to a machine whose sides are alike, and much to what one side's part
# does to the other: its column is run with the effects.
RACKING = 'chain.racking_stiffness_n_m'

Free = Callable[[Beside], Beside]

STEPS = 8
ANEW = 2  # times that the tolerances' effect is taken anew on the way
SHARES = (1.0, 0.4, 0.15)
STRETCH, FARTHEST = 2.5, 7.0  # of a step that explains more
FURTHER = 1.6  # times a step, from where the parabola through its ends has its least: stretch it
SETTLED = 3.0  # chi squared: a step that gains less ends the fit


@dataclass(frozen=True)
class Polished:
    """Effects fitted together with the tolerances.

    Attributes
    ----------
    context : Context
        Whose tolerances act as they do in the machine with the effects.
    place : Beside
        That machine, its tolerances turned.
    effects : tuple of Proposal
        With the fitted numbers.
    sd : tuple of mapping of parameter to float
        One of each effect, by chi squared alone.
    """

    context: Context
    place: Beside
    effects: tuple[Proposal, ...]
    sd: tuple[dict[str, float], ...]


def polish(
    context: Context,
    effects: Sequence[Proposal],
    turned: Mapping[str, float],
    known: Sequence[Proposal] = (),
    free: Free | None = None,
    anew: bool = False,
    jobs: int = 1,
    steps: int = STEPS,
) -> Polished:
    """Fit the numbers of effects of the machine together with its tolerances.

    Parameters
    ----------
    context : Context
    effects : sequence of Proposal
        Of the machine.
    turned : mapping of tolerance to float
        Where the fit begins, standard deviations.
    known : sequence of Proposal
        More effects of the machine, whose numbers stay.
    free : callable, optional
        Frees the nuisance that effects of the measurement stand for.
    anew : bool
        The effects change what the tolerances do: take that anew first.
    jobs : int
        Simulations at a time.
    steps : int
        Of Gauss and Newton, at most.
    """
    effects = tuple(effects)
    stood_for = {e.nuisance for e in (*effects, *known)}
    at = {k: z for k, z in turned.items() if k not in stood_for}
    fit_one = _Fit(context, tuple(k.deviation for k in known), free)
    if anew:
        fit_one = fit_one.taken_anew(effects, at, jobs)
    tangent = dict(at)
    place = fit_one.beside(effects, at)
    spreads = tuple(dict[str, float]() for _ in effects)
    left, helped = ANEW, False
    plain = fit_one.plain(effects)
    if plain is not None and at:
        # without the effects the tolerances had been turned to explain what these explain
        there = plain.beside(effects, {})
        if judged(there, effects) < judged(place, effects):
            fit_one, place, tangent, helped = plain, there, {}, True
    for _ in range(steps):
        white = fit_one.columns(place, effects)
        spreads = _spreads(place, effects, white)
        trial = fit_one.step(place, effects, white)
        if trial is None and not helped:
            helped = True
            eased = fit_one.eased(place, effects, jobs)
            if eased is not None:
                fit_one, place = eased
                tangent = dict(place.stage.turned)
                continue
        if trial is None:
            break
        gained = judged(place, effects) - judged(trial[0], effects)
        place, effects = trial
        if gained < SETTLED:
            break
        away = [abs(z - tangent.get(k, 0.0)) for k, z in place.stage.turned.items()]
        if left and max(away, default=0.0) > FAR_TURNED:
            left -= 1
            tangent = dict(place.stage.turned)
            fit_one = fit_one.taken_anew(effects, tangent, jobs)
            place = fit_one.beside(effects, tangent)
    return Polished(fit_one.context, place, effects, spreads)


def increments(
    context: Context,
    place: Beside,
    effects: Sequence[Proposal],
    known: tuple[Deviation, ...] = (),
) -> tuple[tuple[Proposal, ...], tuple[dict[str, float], ...]]:
    """Return effects as one recording alone would have them, by one step, and their spreads.

    Parameters
    ----------
    context : Context
    place : Beside
        The machine with the effects.
    effects : sequence of Proposal
        Of the machine.
    known : tuple of Deviation
        More of its effects, whose numbers stay.
    """
    effects = tuple(effects)
    white = _Fit(context, known, None).columns(place, effects)
    right, gram = _products(place, effects, white)
    delta = inverse(gram) @ right
    found = tuple(_moved(effects, delta, place.stage.machine_length))
    return found, _spreads(place, effects, white)


def judged(place: Beside, effects: Sequence[Proposal]) -> float:
    """Return what a step is judged by: all channels that one of the effects acts on."""
    shaking = next((e.cause for e in effects if e.cause in SHAKING), None)
    return place.stage.judged(place.fitted, shaking)


@dataclass(frozen=True)
class _Fit:
    """What stays the same over the steps."""

    context: Context
    known: tuple[Deviation, ...]
    free: Free | None

    def deviations(self, effects: Sequence[Proposal]) -> tuple[Deviation, ...]:
        return (*self.known, *(e.deviation for e in effects))

    def taken_anew(
        self, effects: Sequence[Proposal], turned: Mapping[str, float], jobs: int
    ) -> '_Fit':
        """Return the same where the tolerances act as they do in this machine."""
        context = with_own_tolerances(self.context, self.deviations(effects), jobs, turned)
        return replace(self, context=context)

    def beside(self, effects: Sequence[Proposal], turned: Mapping[str, float]) -> Beside:
        place = beside(self.context, self.deviations(effects), steps=0, turned=turned)
        return place if self.free is None else self.free(place)

    def plain(self, effects: Sequence[Proposal]) -> '_Fit | None':
        """Return the same where the tolerances act as in the machine as described.

        None where the effects change what they do.
        """
        nominal = self.context.nominal
        if nominal is None or any(d.cause not in LOCAL for d in self.deviations(effects)):
            return None
        responses = replace(self.context.responses, knobs=nominal.responses.knobs)
        return replace(self, context=replace(self.context, responses=responses))

    def eased(
        self, place: Beside, effects: Sequence[Proposal], jobs: int
    ) -> 'tuple[_Fit, Beside] | None':
        """Tune the tolerances alone and from none, the effects held; None if no more is explained.

        They had been turned to explain what the effects explain now.
        """
        anew = self.taken_anew(effects, {}, jobs)
        tuned = beside(anew.context, self.deviations(effects), turned={})
        after = tuned if self.free is None else self.free(tuned)
        return (anew, after) if judged(after, effects) < judged(place, effects) else None

    def columns(self, place: Beside, effects: Sequence[Proposal]) -> np.ndarray:
        """Return the whitened change by every number of every effect, and by ``_sided``, (m, p)."""
        found = []
        for k, effect in enumerate(effects):
            others = [e.deviation for j, e in enumerate(effects) if j != k]
            bare = replace(place.stage, machine=self.context.machine)
            bare = bare.extended((*self.known, *others))
            found.append(jacobian_of(bare, None, place.model, effect))
        for name in _sided(place, effects):
            turned = {**place.stage.turned, name: place.stage.turned.get(name, 0.0) + 1.0}
            bare = replace(place.stage, machine=self.context.machine, turned=turned)
            change = bare.run(self.deviations(effects)) - place.model
            found.append(place.stage.columns(change[:, :, None], effects[0].cause))
        return np.concatenate(found, axis=1)

    def step(
        self, place: Beside, effects: tuple[Proposal, ...], white: np.ndarray
    ) -> tuple[Beside, tuple[Proposal, ...]] | None:
        """Take the step of Gauss and Newton, or a part of it; None where neither explains more."""
        stage = place.stage
        fitted, kept = _free(place, effects)
        right, gram = _products(place, effects, white)
        delta = inverse(gram) @ right
        rest = fit(fitted.white - white @ delta.astype(np.float32), fitted.columns, fitted.offset)
        sizes = np.zeros(len(stage.nuisance.names))
        sizes[kept] = rest.sizes
        names = {knob.name for knob in stage.knobs} - {e.nuisance for e in effects}
        sided = _sided(place, effects)
        more = dict(zip(sided, delta[len(delta) - len(sided) :], strict=True))

        def tried(share: float) -> tuple[Beside, tuple[Proposal, ...]]:
            trial = tuple(_moved(effects, share * delta, stage.machine_length))
            turned = {
                name: float(np.clip(offset + share * size, -LARGEST, LARGEST))
                for name, offset, size in zip(
                    stage.nuisance.names, stage.offset, sizes, strict=True
                )
                if name in names
            }
            for name, way in more.items():
                z = stage.turned.get(name, 0.0) + share * float(way)
                turned[name] = float(np.clip(z, -LARGEST, LARGEST))
            return self.beside(trial, turned), trial

        best, start = None, judged(place, effects)
        value = start
        for share in SHARES:
            again = tried(share)
            if judged(again[0], effects) < value:
                best, value = again, judged(again[0], effects)
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


def _sided(place: Beside, effects: Sequence[Proposal]) -> tuple[str, ...]:
    """Return the tolerances that only show beside these effects."""
    is_one_sided = any(e.cause in LOCAL and 'side' in e.location for e in effects)
    known = {knob.name for knob in place.stage.knobs}
    return (RACKING,) if is_one_sided and RACKING in known else ()


def _products(
    place: Beside, effects: Sequence[Proposal], white: np.ndarray
) -> tuple[Floats, Floats]:
    """Return the right side and the matrix of the normal equations, tolerances with their priors."""
    fitted, _ = _free(place, effects)
    right, gram = inner_products(fitted, white)
    sided = _sided(place, effects)
    for k, name in enumerate(sided, len(right) - len(sided)):
        right[k] -= place.stage.turned.get(name, 0.0)
        gram[k, k] += 1.0
    return right, gram


def _free(place: Beside, effects: Sequence[Proposal]) -> tuple[Fitted, list[int]]:
    """Return the fit without the tolerances that effects stand for, and which columns it has."""
    names = place.stage.nuisance.names
    fitted, kept = place.fitted, list(range(len(names)))
    for effect in effects:
        if effect.nuisance in names:
            index = kept.index(names.index(str(effect.nuisance)))
            fitted = fitted.without(index)
            kept.pop(index)
    return fitted, kept


def _moved(effects: Sequence[Proposal], delta: Floats, length_m: float) -> list[Proposal]:
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


def _spreads(
    place: Beside, effects: tuple[Proposal, ...], white: np.ndarray
) -> tuple[dict[str, float], ...]:
    """Return one standard deviation of every number, beside all others and the nuisance."""
    _, gram = _products(place, effects, white)
    covariance = inverse(gram)
    found, first = [], 0
    for effect in effects:
        spread = {}
        for i, key in enumerate(effect.fitted, first):
            variance = max(float(covariance[i, i]), 0.0)
            spread[key] = abs(slope_of(effect, key)) * variance**0.5
        found.append(spread)
        first += len(effect.fitted)
    return tuple(found)
