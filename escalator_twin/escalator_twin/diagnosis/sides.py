"""The other sides of what was fitted: which is right must not hang on how far each fit has come."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import pi

import numpy as np

from escalator_twin.diagnosis.context import Beside
from escalator_twin.diagnosis.fitting import fitted_beside
from escalator_twin.diagnosis.floor import PASSED
from escalator_twin.diagnosis.loops import LOCAL
from escalator_twin.diagnosis.proposals import is_other_side, Proposal, same_place
from escalator_twin.diagnosis.refine import Refined
from escalator_twin.diagnosis.search import SIDES
from escalator_twin.diagnosis.split import in_time
from escalator_twin.diagnosis.tried import Tried

# Whose sides look alike but for the axle's racking. A side that explains less, run once, than this share of
# what the first one did is not fitted. An argument, not measured: sides that can be taken for each other explain
# about as much; of one flat spot and one soft link, named on the right side, the other explained 0.5 and 0.3.
ALIKE = 0.6
SIDED = ('roller_drag', 'link_stiffness', 'roller_flat', 'guide_step')
PULLED = ('link_stiffness',)  # of these what the part does is in proportion to its side's tension
UNEVEN = ('chain_elongation', 'load_offset')  # which take tension from one side to the other


def across(contenders: Sequence[Proposal], known: Sequence[Proposal]) -> list[Proposal]:
    """Return contenders on the other side, where a known effect takes tension from side to side.

    They were sought by what they do in a machine whose sides pull alike. Of a chain that is 0.15 mm a link
    longer the empty machine's side pushes, and a soft link in it looks like one of the other side.
    """
    if not any(k.cause in UNEVEN and k.location.get('side') != 'both' for k in known):
        return []
    found = [_across(p) for p in contenders if p.cause in PULLED]
    return [p for p in found if not any(same_place(p, c) for c in contenders)]


def _across(one: Proposal) -> Proposal:
    other = SIDES[1 - SIDES.index(str(one.location['side']))]
    return replace(one, location={**one.location, 'side': other})


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
        if is_other_side(r.proposal, best.proposal)
    }
    if side in SIDES and best.proposal.cause not in PASSED:
        like = next(r for r in refined if r.proposal.cause == best.proposal.cause)
        mirrored = _across(best.proposal)
        other = str(mirrored.location['side'])
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


def weighed_by_passages(tried: Sequence[Tried]) -> list[Tried]:
    """Return what was tried, sides of the best weighed by what chance leaves of their difference.

    The logarithm of the odds is that of the probability that a normal difference leaves: the usual approximation of
    a logistic function's integral over a normal density (MacKay 1992, The evidence framework applied to
    classification networks, Neural Computation 4).
    """
    best = max(tried, key=lambda t: t.gain, default=None)
    if best is None or best.polished is None or best.proposal.cause not in PASSED:
        return list(tried)
    leading = best.polished.place

    def fair(one: Tried) -> Tried:
        if one.polished is None or not is_other_side(one.proposal, best.proposal):
            return one
        nats = 0.5 * chance_of(one.polished.place, leading)
        behind = (best.gain - one.gain) / (1.0 + pi / 8.0 * nats**2) ** 0.5
        return replace(one, gain=best.gain - behind)

    return [fair(one) for one in tried]


def chance_of(one: Beside, other: Beside) -> float:
    """Return the standard deviation of a difference of chi squared, by where along travel it came about.

    As of two models of which neither is quite true (Vuong 1989, Likelihood ratio tests for model selection and
    non-nested hypotheses, Econometrica 57), from sums over blocks that overlap (Kuensch 1989, The jackknife and the
    bootstrap for general stationary observations, Annals of Statistics 17). A step passes a place with both axles, a
    pitch apart, and once a loop: what the twin's law is off by there repeats. Blocks are two pitches long, and loops
    are added up. Rollers that rattle make some such passages all of a difference.
    """
    here, there = one.stage.observation, other.stage.observation
    frame = here.frame
    common, *rows = np.intersect1d(here.index, there.index, return_indices=True)
    left = [np.sum(in_time(p)[at] ** 2, axis=1) for p, at in zip((one, other), rows, strict=True)]
    differs = np.bincount(common % frame.n_loop, left[0] - left[1], frame.n_loop)
    block = 2 * frame.per_pitch
    summed = np.cumsum(np.concatenate([[0.0], differs, differs[:block]]))
    blocks = summed[block:] - summed[:-block]
    return float(np.sum(blocks[:-1] ** 2) / block) ** 0.5
