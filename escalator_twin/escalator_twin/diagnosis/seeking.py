"""What a round of the walk seeks: beside the tolerances as they are tuned, and from the machine as described."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from escalator_twin.diagnosis.afar import Afar, at_the_edge, look_afar, may_hide, MOST_EDGES
from escalator_twin.diagnosis.bounds import Bounds
from escalator_twin.diagnosis.contenders import choose, is_hopeless, is_known_fault
from escalator_twin.diagnosis.context import Beside, Context
from escalator_twin.diagnosis.fitting import MOVES_RESONANCE
from escalator_twin.diagnosis.free import of_machine
from escalator_twin.diagnosis.lone import is_in_one_gauge
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.walked import Bench


@dataclass(frozen=True)
class Sought:
    """Proposals of a round.

    Attributes
    ----------
    proposals : list of Proposal
        Beside the tolerances as they are tuned, best first.
    afar : Afar or None
        From the machine as described; None where the tolerances have taken no effect's place.
    """

    proposals: list[Proposal]
    afar: Afar | None

    def contenders(self, bounds: Bounds) -> list[Proposal]:
        """Return what is to be run beside the tuned tolerances."""
        chosen = [
            p
            for p in choose(self.proposals)
            if bounds.may_stand(p) and not is_hopeless(p, self.proposals)
        ]
        if self.afar is None:
            return chosen
        afar = {p.cause for p in self.afar.proposals} & MOVES_RESONANCE
        return [p for p in chosen if p.cause not in afar]

    def may_stand(self, bounds: Bounds) -> bool:
        """Tell whether any of it may be an effect."""
        afar = self.afar.proposals if self.afar is not None else ()
        return any(bounds.may_stand(p) for p in (*self.proposals, *afar))


def seek(
    bench: Bench,
    context: Context,
    place: Beside,
    known: Sequence[Proposal],
    bounds: Bounds,
    jobs: int = 1,
) -> Sought:
    """Search beside the tolerances as they are, and afar where they may have taken an effect's place.

    Parameters
    ----------
    bench : Bench
    context : Context
    place : Beside
        The machine with the known effects, its tolerances tuned.
    known : sequence of Proposal
        Accepted effects, of machine and measurement.
    bounds : Bounds
        What an effect may explain there.
    jobs : int
        Simulations at a time.
    """
    proposals = [p for p in bench.propose(context, place, jobs) if not is_known_fault(p, known)]
    lone = is_in_one_gauge(place, context.floor)
    if lone:  # what the machine does is in others too
        proposals = [p for p in proposals if not of_machine(p)]
    afar = None
    hides_more = not lone and not bounds.is_left_over('', bounds.most())
    if hides_more and may_hide(place, context.floor, known):
        afar = look_afar(context, jobs, known)
    if afar is not None:
        edges = at_the_edge(afar.proposals, place)[:MOST_EDGES]
        afar = replace(afar, proposals=choose(afar.proposals), edges=edges)
    return Sought(proposals, afar)
