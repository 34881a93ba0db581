"""What a rail's step explains in a step's own x and z, shared with what explains as much there."""

from collections.abc import Sequence
from dataclasses import replace

from escalator_twin.diagnosis.context import Beside
from escalator_twin.diagnosis.floor import PASSED, SHAKING
from escalator_twin.diagnosis.proposals import Proposal, same_place
from escalator_twin.diagnosis.regression import Fitted
from escalator_twin.diagnosis.stage import Stage
from escalator_twin.diagnosis.tried import Tried


def shared(place: Beside, tried: Sequence[Tried]) -> list[Tried]:
    """Take from what acts on a step directly what a rival explains there as well.

    Of most causes a step's x and z are not judged, since rattling rollers roll dice there, and of a
    rail's step they are. But a landing that is longer by millimetres moves where rollers change tracks:
    a rail's step there must explain more than that, where the landing explains as much elsewhere.
    """
    rivals = [t for t in tried if t.polished is not None and t.proposal.cause not in SHAKING]

    def fair(one: Tried) -> Tried:
        own = falls(one)
        if one.proposal.cause not in SHAKING or own is None:
            return one
        elsewhere, there = own
        others = [f for f in map(falls, rivals) if f is not None]
        explained = max((there for rest, there in others if rest >= elsewhere), default=0.0)
        return replace(one, gain=one.gain - min(max(explained, 0.0), max(there, 0.0)))

    def falls(one: Tried) -> tuple[float, float] | None:
        if one.polished is None:
            return one.falls
        return falls_of(place, one.polished.place.stage, one.polished.place.fitted)

    return [fair(one) for one in tried]


def falls_of(place: Beside, stage: Stage, fitted: Fitted) -> tuple[float, float]:
    """Return the fall of chi squared in the channels that no rattling shakes, and in the others."""
    before, whole_before = place.stage.judged(place.fitted), place.fitted.chi2
    after, whole_after = stage.judged(fitted), fitted.chi2
    return before - after, (whole_before - before) - (whole_after - after)


def is_fitted(proposal: Proposal, fitted: Sequence[Tried]) -> bool:
    """Tell whether a rail's step was fitted where one is proposed: what it gained when it was run says nothing more.

    Of what was fitted a step's x and z are shared with rivals, and sides are weighed by their passages.
    """
    if proposal.cause not in PASSED:
        return False
    return any(t.polished is not None and same_place(t.proposal, proposal) for t in fitted)
