"""What the walk asks of a machine of linked chains."""

from collections.abc import Mapping, Sequence

from escalator_twin.diagnosis.context import Beside, Context
from escalator_twin.diagnosis.families import COSTLY, FAMILIES
from escalator_twin.diagnosis.fitting import fit_again
from escalator_twin.diagnosis.further import decide_between
from escalator_twin.diagnosis.hollows import out_of_hollow
from escalator_twin.diagnosis.neighbours import at_neighbours
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.regroup import is_scattered, regrouped, unevenness
from escalator_twin.diagnosis.search import Search, search_all
from escalator_twin.diagnosis.trial import try_all
from escalator_twin.diagnosis.unexplained import excess_of, is_open
from escalator_twin.diagnosis.view import View
from escalator_twin.diagnosis.walked import Bench


def propose(context: Context, place: Beside, jobs: int) -> list[Proposal]:
    """Return what all families of causes propose, best first."""
    view = View.of(
        context.machine,
        place.stage.observation,
        context.responses,
        context.setting.experiment.direction,
    )
    is_left = is_open(place, context.floor)
    stage = place.stage.lean(place.model)
    excess = sum(excess_of(place, context.floor, shaken) for shaken in (False, True))
    search = Search(view, place.fitted, stage, place.model, jobs, is_left, excess=excess)
    return search_all(search, FAMILIES, COSTLY)


def as_it_is(place: Beside, _: Sequence[Proposal]) -> Beside:
    """Return the comparison that effects are judged against: the machine within tolerance."""
    return place


def as_tuned(place: Beside, _: Sequence[Proposal]) -> Mapping[str, float]:
    """Return the tolerances as they were tuned."""
    return place.stage.turned


LINKED = Bench(
    propose,
    try_all,
    fit_again,
    as_it_is,
    decide_between,
    as_tuned,
    out_of_hollow,
    regrouped,
    at_neighbours,
    unevenness,
    is_scattered,
)
