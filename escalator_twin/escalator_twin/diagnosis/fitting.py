"""Fit an effect together with the machine's tolerances and with all that is known already."""

from collections.abc import Mapping, Sequence
from math import inf

from escalator_twin.causes.registry import KNOWN
from escalator_twin.diagnosis.context import Beside, beside, Context
from escalator_twin.diagnosis.free import freed
from escalator_twin.diagnosis.joint import JointFit
from escalator_twin.diagnosis.loops import LOCAL
from escalator_twin.diagnosis.polish import approach, polish, Polished, STEPS
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.refine import Refined
from escalator_twin.diagnosis.stage import LARGEST, Stage
from escalator_twin.diagnosis.tried import Tried
from escalator_twin.diagnosis.tuning import tuned
from escalator_twin.diagnosis.waves import DRIVE, realigned
from escalator_twin.errors import EscalatorError

# Times the chi squared without a cause: where the tolerances lead to more beside it, a fit of both does not
# make up for it. It took 4 and 6 % off where that was looked at (0.967 for 1.0 of a tensioner's spring,
# 5.1e-5 for 5.0e-5 m of a chain's elongation).
MOST_LED = 1.25
# Tolerances at their bounds: of thirteen, three are in one good machine of two thousand. For want of a link 3 mm longer
# six were, and the link was fitted from there with 3.30 mm and a chi squared of 9850; from none, 3.01 and 8016. For want
# of a flat spot four were, and from none it was fitted with 0.56 of 0.60 mm, from there with 0.59 (development).
ASTRAY = 3
STEPS_AT_LENGTH = 2  # of the last fit where every run takes the whole recording's length
# Causes that change the machine so much that its tolerances act otherwise.
MOVES_RESONANCE = frozenset({
    'tensioner_friction', 'tensioner_stop', 'tensioner_stiffness', 'tensioner_preload',
    'drive_stiffness', 'chain_elongation', 'landing_length', 'rolling_resistance',
    'truss_resonance',
})  # fmt: skip


def approached(
    context: Context, place: Beside, known: Sequence[Proposal], refined: Refined, jobs: int
) -> tuple[Context, Mapping[str, float] | None]:
    """Return the tolerances that fit beside a cause and what is known, and what they do there."""
    fit_one = JointFit(context, (), lambda p: freed(p, known))
    effects = [*of_machine_among(known), refined.proposal]
    # what a known effect stands for is in its size
    stood_for = {e.nuisance for e in effects if e.nuisance is not None}
    turned = {k: z for k, z in place.stage.turned.items() if k not in stood_for}
    try:
        start = fit_one.beside(effects, turned)
        fit_one, there, _ = approach(fit_one, start, effects, stood_for, jobs)
    except EscalatorError:
        return context, None
    return fit_one.context, there.stage.turned


def unturned(
    context: Context, place: Beside, known: Sequence[Proposal], refined: Refined, jobs: int
) -> tuple[Context, Mapping[str, float]]:
    """Return no tolerance turned, and what they do beside a cause and what is known."""
    effects = [*of_machine_among(known), refined.proposal]
    none = dict.fromkeys(place.stage.turned, 0.0)
    return JointFit(context, (), None).taken_anew(effects, none, jobs).context, none


def is_astray(stage: Stage) -> bool:
    """Tell whether tolerances were turned as far as they may be, for want of the cause that was there."""
    return sum(abs(z) >= LARGEST for z in stage.turned.values()) >= ASTRAY


def of_machine_among(known: Sequence[Proposal]) -> list[Proposal]:
    """Return the known effects of the machine: they are fitted on beside a further one."""
    return [k for k in known if KNOWN[k.cause].of_machine]


def plain(refined: Refined) -> Tried:
    """Return what was refined and not fitted with all else."""
    return Tried(refined.proposal, refined.gain, dict(refined.sd))


def fitted_beside(
    context: Context,
    place: Beside,
    known: Sequence[Proposal],
    refined: Refined,
    turned: Mapping[str, float] | None = None,
    jobs: int = 1,
    level: float = inf,
) -> Tried:
    """Fit a refined cause together with the tolerances and what is known already.

    ``turned`` is where the tolerances begin: where they are at ``place``, unless it is given. ``level`` is the
    chi squared of what leads.
    """
    if refined.proposal.cause in DRIVE:
        refined = realigned(context, place, refined, jobs)
    before = place.stage.judged(place.fitted, refined.proposal.cause)
    try:
        polished = polish(
            context,
            [*of_machine_among(known), refined.proposal],
            place.stage.turned if turned is None else turned,
            lambda p: freed(p, known),
            refined.proposal.cause in MOVES_RESONANCE,
            jobs,
            STEPS_AT_LENGTH if refined.proposal.cause in LOCAL else STEPS,
            is_near=turned is not None and bool(turned),
            most=inf if turned is None or turned else MOST_LED * min(before, level),
        )
    except EscalatorError:
        return plain(refined)
    proposal = polished.effects[-1]
    gain = before - polished.place.stage.judged(polished.place.fitted, proposal.cause)
    if turned is None and gain <= 0.5 * refined.gain:
        return plain(refined)
    return Tried(proposal, gain, polished.sd[-1], polished)


def fitted_near(known: Sequence[Proposal], tried: Tried, near: Polished, jobs: int = 1) -> Tried:
    """Fit what was weighed alone with all else too, from where nearly the same effect ended.

    Parameters
    ----------
    known : sequence of Proposal
        Of machine and measurement.
    tried : Tried
    near : Polished
        The known effects of the machine, fitted, and last the one that this one is nearly the same as.
    jobs : int
        Simulations at a time.
    """
    effects = [*near.effects[:-1], tried.proposal]
    try:
        polished = fitted_on(near.context, known, effects, near.place.stage.turned, jobs)
    except EscalatorError:
        return tried
    return Tried(polished.effects[-1], tried.gain, polished.sd[-1], polished)


def fitted_on(
    context: Context,
    known: Sequence[Proposal],
    effects: Sequence[Proposal],
    turned: Mapping[str, float],
    jobs: int = 1,
) -> Polished:
    """Fit effects of the machine from where the tolerances fit beside much the same ones.

    ``known`` are all that are accepted, of machine and measurement.
    """
    if not effects:  # the tolerances fit already
        return Polished(context, JointFit(context, (), None).beside((), turned), (), ())
    return polish(
        context,
        effects,
        turned,
        lambda p: freed(p, known),
        jobs=jobs,
        steps=STEPS_AT_LENGTH,
        is_near=True,
    )


def fit_again(
    context: Context, place: Beside, known: Sequence[Proposal], jobs: int = 1
) -> Polished:
    """Fit known effects once more, beside what was found of the measurement since.

    What a gauge's fault did to the signals had been taken for theirs, or for a tolerance's.

    Parameters
    ----------
    context : Context
    place : Beside
        The machine with its effects.
    known : sequence of Proposal
        All of them, of machine and measurement.
    jobs : int
        Simulations at a time.
    """
    again = of_machine_among(known)
    turned = place.stage.turned
    if not again:  # the tolerances were tuned to this machine
        return Polished(context, beside(context, steps=0, turned=turned), (), ())
    try:
        return polish(
            context,
            again,
            turned,
            lambda p: freed(p, known),
            any(e.cause in MOVES_RESONANCE for e in again),
            jobs,
            STEPS_AT_LENGTH if any(e.cause in LOCAL for e in again) else STEPS,
        )
    except EscalatorError:  # as it was, its tolerances tuned
        deviations = tuple(k.deviation for k in again)
        return Polished(*tuned(context, deviations, jobs, turned), (), ())
