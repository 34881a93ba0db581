"""A machine without an effect that is as near to a recording as the one with it.

A tuning of tolerances may end in a hollow. What is fitted beside tolerances tuned anew then seems to explain
what these explain without it: of a good machine, slow and loaded, a spring and steps of the rail took 1600 to 2700
of a chi squared of 14100, and the tolerances found beside them took as much with none of them in the machine. The same
beside an accepted effect: where a stretch dragged, a step of the rail of 0.48 mm explained 5966 of 21821, and one of
none at all, fitted with the tolerances on its other side, 5970.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from escalator_twin.diagnosis.context import Beside, beside, Context, with_own_tolerances
from escalator_twin.diagnosis.descent import level_of
from escalator_twin.diagnosis.fitting import fitted_on
from escalator_twin.diagnosis.free import freed
from escalator_twin.diagnosis.joint import JointFit
from escalator_twin.diagnosis.polish import Polished
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.stage import LARGEST, Stage
from escalator_twin.diagnosis.tried import Tried
from escalator_twin.diagnosis.unexplained import beyond_tolerance
from escalator_twin.diagnosis.verdict import neutral_of
from escalator_twin.errors import EscalatorError

# Of what an effect explains: where its tolerances take more without it, it is judged beside these.
SHARE = 0.5


def out_of_hollow(
    context: Context, place: Beside, known: Sequence[Proposal], tried: Tried, jobs: int = 1
) -> Polished | None:
    """Return the machine without an effect that takes most of what the effect explains; None without one.

    Parameters
    ----------
    context : Context
    place : Beside
        The machine with all that is known, its tolerances tuned.
    known : sequence of Proposal
        Effects that are accepted, of machine and measurement.
    tried : Tried
        What leads beside it.
    jobs : int
        Simulations at a time.

    Returns
    -------
    polished : Polished
        The known effects of the machine, fitted where the tolerances beside the new one ended.
    """
    if tried.polished is None:
        return None
    cause = tried.proposal.cause if known else None
    now, with_it = (p.stage.judged(p.fitted, cause) for p in (place, tried.polished.place))
    most = now - SHARE * (now - with_it)
    if most >= now:
        return None
    turned = _turned(tried.proposal, tried.polished.place.stage)
    try:
        if known:
            found = _with_known(known, tried.polished, turned, most, jobs)
        else:
            found = _within_tolerance(context, place, turned, most, jobs)
    except EscalatorError:  # no machine runs with these: what leads is judged as it is
        return None
    if found is None or found.place.stage.judged(found.place.fitted, cause) >= most:
        return None
    return None if _holds(found.place, tried.proposal) else found


def _holds(place: Beside, effect: Proposal) -> bool:
    """Tell whether a machine without an effect has it after all, in the tolerance that it stands for.

    What a tolerance explains by its slope hardly resists: beside a longer link a spring of 1.4 was taken up as
    eleven tolerances of the spring.
    """
    return effect.nuisance in beyond_tolerance(place)


def _within_tolerance(
    context: Context, place: Beside, turned: dict[str, float], most: float, jobs: int
) -> Polished | None:
    """Return the machine within tolerance with other tolerances, where these promise less than ``most``."""
    if level_of(place, replace(place.stage, turned=turned)) >= most:
        return None
    near = with_own_tolerances(context, (), jobs, turned)
    after = beside(near, steps=1, turned=turned)
    return Polished(replace(near, place=after), after, (), ())


def _with_known(
    known: Sequence[Proposal],
    polished: Polished,
    turned: dict[str, float],
    most: float,
    jobs: int,
) -> Polished | None:
    """Return the machine with what is known fitted from other tolerances, where these leave less than ``most``."""
    cause = polished.effects[-1].cause
    before = JointFit(polished.context, (), lambda p: freed(p, known))
    there = before.beside(polished.effects[:-1], turned)
    if there.stage.judged(there.fitted, cause) >= most or _holds(there, polished.effects[-1]):
        return None
    found = fitted_on(polished.context, known, polished.effects[:-1], turned, jobs)
    return replace(found, place=freed(found.place, known))


def _turned(effect: Proposal, stage: Stage) -> dict[str, float]:
    """Return the tolerances beside an effect; the one that it stands for as far as that reaches."""
    name = effect.nuisance or ''
    if name not in stage.tolerances or not effect.fitted:
        return dict(stage.turned)
    key = effect.fitted[0]
    size = effect.parameters[key] - neutral_of(effect.cause, key)
    return {**stage.turned, name: float(np.clip(size / stage.tolerances[name], -LARGEST, LARGEST))}
