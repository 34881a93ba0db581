"""Causes that are sought from the machine as described, before any tolerance is turned.

A large change of a spring or of the preload looks, from where the tolerances have been tuned to it,
like nothing at all: they have taken its place, each within its bounds. From the machine as described,
or from that with the effects that are known already, it stands out.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from escalator_twin.causes.application import apply
from escalator_twin.diagnosis.context import Beside, beside, Context, Nominal
from escalator_twin.diagnosis.floor import Floor
from escalator_twin.diagnosis.free import freed, of_machine
from escalator_twin.diagnosis.large_effects import find_far
from escalator_twin.diagnosis.loops import LOCAL
from escalator_twin.diagnosis.polish import taken_over
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.responses import tolerances_only
from escalator_twin.diagnosis.search import Search, search_all
from escalator_twin.diagnosis.search_whole import far, stops, tolerances, whole
from escalator_twin.diagnosis.unexplained import is_open, SIGMAS
from escalator_twin.diagnosis.view import View
from escalator_twin.errors import EscalatorError
from escalator_twin.machine import Deviation, Machine

EDGE = 2.0  # standard deviations from which a tolerance may stand in for an effect
MOST_EDGES = 2  # fitted in a round


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
    edges : tuple of Proposal
        Fitted whatever they promise, see `at_the_edge`: beside known effects always, else where no
        fit explains most of what is open or hidden.
    """

    context: Context
    place: Beside
    proposals: list[Proposal]
    edges: tuple[Proposal, ...] = ()


def look_afar(context: Context, jobs: int = 1, known: Sequence[Proposal] = ()) -> Afar | None:
    """Search from the machine as described; None where there is no such comparison.

    Parameters
    ----------
    context : Context
    jobs : int
        Simulations at a time.
    known : sequence of Proposal
        Effects that the machine has beside what is sought.
    """
    experiment = context.setting.experiment
    deviations = tuple(p.deviation for p in known if of_machine(p))
    # what one link, axle or step has changes next to nothing of what the whole machine does
    machine = apply(context.machine, tuple(d for d in deviations if d.cause not in LOCAL))
    try:
        nominal = _untuned(context, machine, deviations, jobs)
        if nominal is None:
            return None
        responses = find_far(machine, experiment, nominal.responses, jobs)
    except EscalatorError:
        return None
    responses = replace(responses, whole=context.responses.whole)
    place = freed(nominal.place, known)
    view = View.of(context.machine, place.stage.observation, responses, experiment.direction)
    search = Search(view, place.fitted, place.stage, place.model, jobs)
    found = search_all(search, (whole, tolerances, far, stops))
    return Afar(replace(context, responses=nominal.responses, own=None), place, found)


def _untuned(
    context: Context, machine: Machine, deviations: tuple[Deviation, ...], jobs: int
) -> Nominal | None:
    """Return a machine with deviations beside the recording, no tolerance turned."""
    if context.nominal is None or not deviations:
        return context.nominal
    responses = tolerances_only(machine, context.setting.experiment, jobs, context.begin)
    place = beside(replace(context, responses=responses, own=None), deviations, steps=0)
    return Nominal(place, responses)


def may_hide(place: Beside, floor: Floor, known: Sequence[Proposal]) -> bool:
    """Tell whether the tolerances may have taken an effect's place.

    Beside known effects they have not where no more is left than in a good machine, and none of them is
    at its edge.
    """
    turned = place.stage.turned.values()
    return not known or is_open(place, floor, SIGMAS) or max(map(abs, turned), default=0.0) >= EDGE


def at_the_edge(proposals: Sequence[Proposal], tuned: Beside) -> tuple[Proposal, ...]:
    """Return the causes whose tolerance the tuning has used up, as large as it was turned.

    Slopes taken at the machine as described say little of a landing that is longer by many of them:
    it moves rollers by as much as the signals' waves are long. That its tolerance ends at its edge says more.

    Parameters
    ----------
    proposals : sequence of Proposal
        One of each such cause, of any size.
    tuned : Beside
        The machine with the known effects, its tolerances tuned.

    Returns
    -------
    edges : tuple of Proposal
        The farthest turned first.
    """
    turned, tolerances = tuned.stage.turned, tuned.stage.tolerances
    edges: dict[str, Proposal] = {}
    for proposal in proposals:
        name = proposal.nuisance or ''
        if abs(turned.get(name, 0.0)) < EDGE or name in edges or not proposal.fitted:
            continue
        key = proposal.fitted[0]
        none = replace(proposal, parameters={key: 1.0 if key == 'factor' else 0.0})
        edges[name] = taken_over(none, turned, tolerances)
    return tuple(edges[name] for name in sorted(edges, key=lambda name: -abs(turned[name])))
