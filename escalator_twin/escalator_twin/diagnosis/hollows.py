"""A machine within tolerance that is as near to a recording as one with an effect.

A tuning of tolerances may end in a hollow. What is fitted beside tolerances tuned anew then seems to explain
what these explain without it: of a good machine, slow and loaded, a spring and steps of the rail took 1600 to 2700
of a chi squared of 14100, and the tolerances found beside them took as much with none of them in the machine.
"""

from dataclasses import replace

import numpy as np

from escalator_twin.diagnosis.context import (
    Beside,
    beside,
    Context,
    quiet_chi2,
    with_own_tolerances,
)
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.stage import LARGEST, Stage
from escalator_twin.diagnosis.tried import Tried
from escalator_twin.diagnosis.tuning import level_of
from escalator_twin.diagnosis.verdict import neutral_of
from escalator_twin.errors import EscalatorError

# Of what an effect explains: where its tolerances take more without it, it is judged beside these.
SHARE = 0.5


def out_of_hollow(
    context: Context, place: Beside, tried: Tried, jobs: int = 1
) -> tuple[Context, Beside] | None:
    """Return a machine within tolerance that takes most of what an effect explains; None without one.

    Parameters
    ----------
    context : Context
    place : Beside
        The machine within tolerance, its tolerances tuned.
    tried : Tried
        What leads beside it.
    jobs : int
        Simulations at a time.

    Returns
    -------
    context : Context
        Whose tolerances act as they do there.
    place : Beside
    """
    if tried.polished is None:
        return None
    now = quiet_chi2(place)
    most = now - SHARE * (now - quiet_chi2(tried.polished.place))
    turned = _turned(tried.proposal, tried.polished.place.stage)
    if most >= now:
        return None
    try:
        if level_of(place, replace(place.stage, turned=turned)) >= most:
            return None
        near = with_own_tolerances(context, (), jobs, turned)
        after = beside(near, steps=1, turned=turned)
    except EscalatorError:  # no machine runs with these: what leads is judged as it is
        return None
    if quiet_chi2(after) >= most:
        return None
    return replace(near, place=after), after


def _turned(effect: Proposal, stage: Stage) -> dict[str, float]:
    """Return the tolerances beside an effect; the one that it stands for as far as that reaches."""
    name = effect.nuisance or ''
    if name not in stage.tolerances or not effect.fitted:
        return dict(stage.turned)
    key = effect.fitted[0]
    size = effect.parameters[key] - neutral_of(effect.cause, key)
    return {**stage.turned, name: float(np.clip(size / stage.tolerances[name], -LARGEST, LARGEST))}
