"""Fit effects and tolerances together, with the twin run at every step.

An effect and a tolerance may do nearly the same: dry friction and damping of the carriage, its
spring and the preload. Fitted in turns they creep along the valley between them; together they
take it in a few steps.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf

from escalator_twin.diagnosis.context import Beside, Context, FAR_TURNED, quiet_chi2
from escalator_twin.diagnosis.descent import far_turns, KICKS, most_explaining
from escalator_twin.diagnosis.joint import Free, JointFit, judged, moved_all
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.regression import inverse
from escalator_twin.diagnosis.tuning import ROUNDS
from escalator_twin.diagnosis.verdict import size_in_tolerances
from escalator_twin.machine import Deviation

STEPS = 8
WHOLE_STEPS = 4  # each costs a run of every tolerance
APPROACHES = 3  # beside an effect that takes a tolerance over: each leads as far as that reaches
ANEW = 2  # times that the tolerances' effect is taken anew on the way
SETTLED = 3.0  # chi squared: a step that gains less ends the fit
# Times the chi squared above which nothing is fitted: where slopes lead to more, turning tolerances far does not
# make up for it either. It took 23 % off at most where that was looked at.
HOPELESS = 1.6
# Of chi squared, unless an effect took over so much of a tolerance that more may follow, and that much less is left.
FALLS = 0.95


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
    free: Free | None = None,
    anew: bool = False,
    jobs: int = 1,
    steps: int = STEPS,
    is_near: bool = False,
    most: float = inf,
) -> Polished:
    """Fit the numbers of effects of the machine together with its tolerances.

    Parameters
    ----------
    context : Context
    effects : sequence of Proposal
        Of the machine.
    turned : mapping of tolerance to float
        Where the fit begins, standard deviations.
    free : callable, optional
        Frees the nuisance that effects of the measurement stand for.
    anew : bool
        The effects change what the tolerances do: take that anew first, where the fit begins near.
    jobs : int
        Simulations at a time.
    steps : int
        Of Gauss and Newton, at most.
    is_near : bool
        ``turned`` is where the tolerances fit: it was found beside much the same effects.
    most : float
        Chi squared: where the tolerances lead to more, nothing is fitted.
    """
    effects = tuple(effects)
    stood_for = {str(e.nuisance) for e in effects}
    at = {k: z for k, z in turned.items() if k not in stood_for}
    fit_one = JointFit(context, (), free)
    if anew and is_near:
        fit_one = fit_one.taken_anew(effects, at, jobs)
    place = fit_one.beside(effects, at)
    if not is_near:
        fit_one, place, effects = led(fit_one, place, effects, jobs, most)
    tangent = dict(place.stage.turned)
    spreads = tuple(dict[str, float]() for _ in effects)
    left = ANEW
    for _ in range(steps if judged(place, effects) <= most else 0):
        white = fit_one.columns(place, effects, jobs)
        spreads = fit_one.spreads(place, effects, white)
        trial = fit_one.step(place, effects, white, jobs)
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


def led(
    fit_one: JointFit,
    place: Beside,
    effects: tuple[Proposal, ...],
    jobs: int = 1,
    most: float = inf,
) -> tuple[JointFit, Beside, tuple[Proposal, ...]]:
    """Tune the tolerances beside effects from none; what effects stand for goes into their sizes.

    That leads as far as a tolerance reaches, and is done again where more may follow. ``most``: see `polish`.
    """
    if all(e.nuisance is None for e in effects):
        return approach(fit_one, place, effects, jobs=jobs, most=most)
    for _ in range(APPROACHES):
        before = effects
        fit_one, place, effects = approach(fit_one, place, effects, jobs=jobs, rounds=1, most=most)
        if not is_far(before, effects):
            break
    return fit_one, place, effects


def approach(
    fit_one: JointFit,
    place: Beside,
    effects: Sequence[Proposal],
    held: Collection[str] = (),
    jobs: int = 1,
    rounds: int = ROUNDS,
    most: float = inf,
) -> tuple[JointFit, Beside, tuple[Proposal, ...]]:
    """Tune the tolerances beside effects from none, where that comes nearer than they are.

    Without the effects they had been turned to explain what these explain. Where a tolerance is turned
    that an effect stands for, the effect's size takes it over. ``rounds``: see `coarse_to_fine`; ``most``:
    see `polish`.
    """
    way, level = fit_one.tuned(effects, held, jobs, rounds, HOPELESS * most)
    # of two effects that stand for one tolerance the last takes it over
    last = {e.nuisance: k for k, e in enumerate(effects)}
    sized = tuple(
        taken_over(e, way, place.stage.tolerances) if last[e.nuisance] == k else e
        for k, e in enumerate(effects)
    )
    if level >= HOPELESS * most:
        leads_on = is_far(effects, sized) and level < FALLS * judged(place, effects)
        if not leads_on:
            return fit_one, place, tuple(effects)
    own = {e.nuisance for e in effects} - set(held)
    way = {name: z for name, z in way.items() if name not in own}
    other = fit_one.taken_anew(sized, way, jobs)
    there = other.beside(sized, way)
    if judged(there, effects) < judged(place, effects):
        return other, there, sized
    return fit_one, place, tuple(effects)


def is_far(before: Sequence[Proposal], after: Sequence[Proposal]) -> bool:
    """Tell whether an effect took over so much of a tolerance that more may follow."""
    return any(
        abs(size_in_tolerances(one) - size_in_tolerances(other)) > 1.0
        for one, other in zip(before, after, strict=True)
        if one.nuisance is not None
    )


def taken_over(
    effect: Proposal, turned: Mapping[str, float], tolerances: Mapping[str, float]
) -> Proposal:
    """Return an effect with the turn of the tolerance that it stands for in its size.

    Parameters
    ----------
    effect : Proposal
    turned : mapping of tolerance to float
        Standard deviations.
    tolerances : mapping of tolerance to float
        One standard deviation, as a share or in m.
    """
    z = turned.get(effect.nuisance or '', 0.0)
    if effect.nuisance is None or z == 0.0 or not effect.fitted:
        return effect
    key, step = effect.fitted[0], z * tolerances[effect.nuisance]
    size = effect.parameters[key]
    size = size * (1.0 + step) if key == 'factor' else size + step
    return replace(effect, parameters={**effect.parameters, key: size})


def polish_whole(
    polished: Polished,
    free: Free | None = None,
    jobs: int = 1,
    worth: float = SETTLED,
    steps: int = WHOLE_STEPS,
) -> Polished:
    """Fit on, with what each tolerance does run with the effects themselves in the machine.

    How a chain rings after a flat spot's blow is a matter of its damping: what a tolerance does to a
    machine without the effects says nothing of that.

    Parameters
    ----------
    polished : Polished
        Where the fit begins.
    free, jobs
        As of `polish`.
    worth : float
        Chi squared: a step that gains less is the last one.
    steps : int
        At most.
    """
    effects, place, spreads = polished.effects, polished.place, polished.sd
    fit_one = JointFit(polished.context, (), free)
    before = None
    for _ in range(steps):
        turned = place.stage.turned
        if before is None:
            fit_one = fit_one.taken_whole(place, effects, jobs)
        else:
            fit_one = fit_one.by_secant(*before, turned)
        place = fit_one.beside(effects, turned)
        before = (place, effects)
        white = fit_one.columns(place, effects, jobs)
        spreads = fit_one.spreads(place, effects, white)
        trial = fit_one.step(place, effects, white, jobs)
        if trial is None:
            break
        gained = judged(place, effects) - judged(trial[0], effects)
        place, effects = trial
        if gained < worth:
            break
    return Polished(fit_one.context, place, effects, spreads)


def farther(polished: Polished, jobs: int = 1, worth: float = SETTLED) -> dict[str, float] | None:
    """Return the tolerances with that one turned far which then explains most; None without gain.

    Parameters
    ----------
    polished : Polished
    jobs : int
        Simulations at a time.
    worth : float
        Chi squared: a turn that gains less is none.
    """
    place = polished.place
    held = polished.context.weak | {str(e.nuisance) for e in polished.effects}
    ways = far_turns(place.stage, KICKS[0], held)
    if not ways:
        return None
    turned, level = most_explaining(place, ways, jobs)
    return turned if quiet_chi2(place) - level >= worth else None


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
    fit_one = JointFit(context, known, None)
    white = fit_one.columns(place, effects)
    right, gram = fit_one.products(place, effects, white)
    delta = inverse(gram) @ right
    found = tuple(moved_all(effects, delta, place.stage.machine_length))
    return found, fit_one.spreads(place, effects, white)
