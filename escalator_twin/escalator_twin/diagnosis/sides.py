"""The other sides of what was fitted: which is right must not hang on how far each fit has come."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from escalator_twin.diagnosis.context import Beside
from escalator_twin.diagnosis.fitting import fitted_beside
from escalator_twin.diagnosis.loops import LOCAL
from escalator_twin.diagnosis.proposals import Proposal, same_place
from escalator_twin.diagnosis.refine import Refined
from escalator_twin.diagnosis.search import SIDES
from escalator_twin.diagnosis.tried import Tried

# Whose sides look alike but for the axle's racking. A side that explains less, run once, than this share of
# what the first one did is not fitted. An argument, not measured: sides that can be taken for each other explain
# about as much; of one flat spot and one soft link, named on the right side, the other explained 0.5 and 0.3.
ALIKE = 0.6
SIDED = ('roller_drag', 'link_stiffness', 'roller_flat', 'guide_step')


def other_sides(
    place: Beside,
    known: Sequence[Proposal],
    refined: Sequence[Refined],
    fitted: Sequence[Tried],
    jobs: int,
    gain_of: Callable[[Proposal], float],
) -> list[Tried]:
    """Fit the best on its other sides too, from the tolerances that it ended with.

    Where the sides differ by little, which is right must not hang on how far each fit has come.

    Parameters
    ----------
    refined : sequence of Refined
        All contenders.
    fitted : sequence of Tried
        The leading ones.
    gain_of : callable
        What a proposal that is run once gains at its best size.
    """
    best = max((t for t in fitted if t.polished is not None), key=lambda t: t.gain, default=None)
    if best is None or best.polished is None or best.proposal.cause not in SIDED:
        return []
    side = best.proposal.location.get('side')
    others = {
        str(r.proposal.location['side']): r
        for r in reversed(refined)
        if r.proposal.cause == best.proposal.cause
        and r.proposal.location['side'] != side
        and is_beside(r.proposal, best.proposal)
    }
    if side in SIDES and best.proposal.cause != 'guide_step':
        other = SIDES[1 - SIDES.index(str(side))]
        location = {**best.proposal.location, 'side': other}
        like = next(r for r in refined if r.proposal.cause == best.proposal.cause)
        mirrored = replace(best.proposal, location=location)
        others = {other: replace(like, proposal=mirrored, gain=gain_of(mirrored))}
    own = max(r.gain for r in refined if r.proposal.cause == best.proposal.cause)
    others = {name: r for name, r in others.items() if r.gain > ALIKE * own}
    turned = best.polished.place.stage.turned
    context = best.polished.context
    if best.proposal.cause in LOCAL:  # all leading ones began at the same tolerances
        done = [t.proposal for t in fitted if t.polished is not None]
        others = {
            name: r
            for name, r in others.items()
            if not any(same_place(r.proposal, d) for d in done)
        }
    found = [fitted_beside(context, place, known, r, turned, jobs) for r in others.values()]
    return [t for t in found if t.polished is not None]


def is_beside(one: Proposal, other: Proposal) -> bool:
    """Tell whether two proposals sit at the same place but for the side."""
    place = {**one.location, 'side': other.location['side']}
    return same_place(replace(one, location=place), other)
