"""Beside effects whose sizes are known: fit what is a recording's own, and the tolerances."""

from collections.abc import Sequence
from dataclasses import replace

from escalator_twin.diagnosis.context import Beside, Context, quiet_chi2
from escalator_twin.diagnosis.joint import JointFit, judged
from escalator_twin.diagnosis.loops import LOCAL
from escalator_twin.diagnosis.polish import polish_whole, Polished, SETTLED
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.tuning import far_turns, KICKS, most_explaining, WORTH_A_ROUND
from escalator_twin.diagnosis.unexplained import is_open

TREADS = ('roller_eccentricity', 'roller_flat')
OWN = ('phase_rad', 'slip')  # of a tread, in every recording another
MOST_STEPS = 2  # of fitting these: time; most of what more steps gain is gained
MOST_KICKS = 3  # each costs four runs of every tolerance


def _own(effects: Sequence[Proposal]) -> tuple[Proposal, ...]:
    """Return the effects with what of them is each recording's own left to be fitted."""
    return tuple(replace(e, fitted=OWN if e.cause in TREADS else ()) for e in effects)


def _again(effects: Sequence[Proposal], own: Sequence[Proposal]) -> list[Proposal]:
    rows = zip(effects, own, strict=True)
    return [replace(e, parameters=fitted.parameters) for e, fitted in rows]


def settled(
    context: Context, place: Beside, effects: Sequence[Proposal]
) -> tuple[Beside, list[Proposal]]:
    """Fit what of treads is each recording's own, and what only shows beside them; sizes stay.

    How a roller stood was read beside the machine as described, and how far the sides' stiffness against
    each other is off shows only beside what acts on one of them.

    Parameters
    ----------
    context : Context
        With the tolerances as they act in the machine with the effects.
    place : Beside
        That machine.
    effects : sequence of Proposal
        Of the machine, all of them.
    """
    if not any(e.cause in LOCAL and 'side' in e.location for e in effects):
        return place, list(effects)
    own = _own(effects)
    fit_one = JointFit(context, (), None)
    place = fit_one.beside(own, place.stage.turned)
    for _ in range(MOST_STEPS):
        trial = fit_one.step(place, own, fit_one.columns(place, own))
        if trial is None:
            break
        gained = judged(place, own) - judged(trial[0], own)
        place, own = trial
        if gained < SETTLED:
            break
    return place, _again(effects, own)


def led_whole(
    context: Context, place: Beside, effects: Sequence[Proposal]
) -> tuple[Context, Beside, list[Proposal]]:
    """Tune the tolerances on with the effects themselves in every run, where much is left; sizes stay.

    `tuned` keeps what effects of single links do. Beside a longer chain, how a longer link pulls is
    another with stiffer contacts: by 0.6 of itself where these were 2 standard deviations off.

    Parameters
    ----------
    context : Context
        With the tolerances as they act in the machine with the effects.
    place : Beside
        That machine.
    effects : sequence of Proposal
        Of the machine, all of them.
    """
    own = _own(effects)
    for _ in range(MOST_KICKS if any(e.cause in LOCAL for e in effects) else 0):
        if not is_open(place, context.floor):
            break
        held = context.weak | {str(e.nuisance) for e in effects}
        ways = far_turns(place.stage, KICKS[0], held)
        if not ways:
            break
        turned, level = most_explaining(place, ways, 1)
        if level > quiet_chi2(place) - WORTH_A_ROUND:
            break
        near = JointFit(context, (), None).beside(own, turned)
        found = polish_whole(Polished(context, near, own, ()))
        if judged(found.place, own) >= judged(place, own):
            break
        context, place, own = found.context, found.place, found.effects
    return context, place, _again(effects, own)
