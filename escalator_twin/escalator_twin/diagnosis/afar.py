"""Causes that are sought from the machine as described, before any tolerance is turned.

A large change of a spring or of the preload looks, from where the tolerances have been tuned to it,
like nothing at all: they have taken its place, each within its bounds. From the machine as described
it stands out.
"""

from dataclasses import dataclass, replace

from escalator_twin.diagnosis.context import Beside, Context
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.responses import find_far
from escalator_twin.diagnosis.search import Search, search_all
from escalator_twin.diagnosis.search_whole import far, stops, tolerances, whole
from escalator_twin.diagnosis.view import View
from escalator_twin.errors import EscalatorError


@dataclass(frozen=True)
class Afar:
    """Proposals for the machine as described.

    Attributes
    ----------
    context : Context
        Whose tolerances act as in that machine.
    place : Beside
    proposals : list of Proposal
        Best first.
    """

    context: Context
    place: Beside
    proposals: list[Proposal]


def look_afar(context: Context, jobs: int = 1) -> Afar | None:
    """Search from the machine as described; None where there is no such comparison."""
    nominal = context.nominal
    if nominal is None:
        return None
    experiment = context.setting.experiment
    try:
        responses = find_far(context.machine, experiment, nominal.responses, jobs)
    except EscalatorError:
        return None
    responses = replace(responses, whole=context.responses.whole)
    place = nominal.place
    view = View.of(context.machine, place.stage.observation, responses, experiment.direction)
    search = Search(view, place.fitted, place.stage, place.model, jobs)
    found = search_all(search, (whole, tolerances, far, stops))
    return Afar(replace(context, responses=nominal.responses), place, found)
