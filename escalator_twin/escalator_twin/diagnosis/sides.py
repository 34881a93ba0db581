"""The other sides of what was fitted: which is right must not hang on how far each fit has come."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import pi

import numpy as np

from escalator_twin.diagnosis.context import Beside
from escalator_twin.diagnosis.fitting import fitted_beside
from escalator_twin.diagnosis.floor import PASSED
from escalator_twin.diagnosis.loops import LOCAL
from escalator_twin.diagnosis.proposals import is_beside, is_other_side, Proposal, same_place
from escalator_twin.diagnosis.refine import Refined
from escalator_twin.diagnosis.search import SIDES
from escalator_twin.diagnosis.split import in_time
from escalator_twin.diagnosis.tried import Tried

# Whose sides look alike but for the axle's racking. A side that explains less, run once, than this share of
# what the first one did is not fitted. An argument, not measured: sides that can be taken for each other explain
# about as much; of one flat spot and one soft link, named on the right side, the other explained 0.5 and 0.3.
ALIKE = 0.6
HIGHER = 1.5  # times the height of a bump that was fitted: where a fit begins again
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
        if is_other_side(r.proposal, best.proposal)
    }
    if side in SIDES and best.proposal.cause not in PASSED:
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


def higher(
    place: Beside, known: Sequence[Proposal], fitted: Sequence[Tried], jobs: int
) -> list[Tried]:
    """Fit the best once more from a higher bump, where it is one that is passed.

    What rollers that leave their track do turns over with the height, and a low bump leaves fewer blows to be wrong of:
    a fit that begins low stays there, with less explained.

    Parameters
    ----------
    place : Beside
        Without it.
    known : sequence of Proposal
        Effects.
    fitted : sequence of Tried
    jobs : int
        Simulations at a time.
    """
    best = max((t for t in fitted if t.polished is not None), key=lambda t: t.gain, default=None)
    if best is None or best.polished is None or best.proposal.cause not in PASSED:
        return []
    there = best.polished.place
    key = best.proposal.fitted[0]
    size = {**best.proposal.parameters, key: HIGHER * best.proposal.parameters[key]}
    start = Refined(
        replace(best.proposal, parameters=size), there.model, there.fitted, best.gain, best.sd,
        np.empty((0, 0)), best.proposal.fitted,
    )  # fmt: skip
    found = fitted_beside(best.polished.context, place, known, start, there.stage.turned, jobs)
    return [found] if found.polished is not None else []


def weighed_by_passages(tried: Sequence[Tried]) -> list[Tried]:
    """Return what was tried, sides of the best weighed by what tells them apart, and by how much chance is in that.

    A step's x and z are those of its middle, where half a bump on both sides is one on either: all that they
    tell of sides is by how far rollers leave their track. So sides are weighed by the channels that no rattling shakes.
    The logarithm of the odds is that of the probability that a normal difference leaves: the usual approximation of
    a logistic function's integral over a normal density (MacKay 1992, The evidence framework applied to
    classification networks, Neural Computation 4).
    """
    fitted = [t for t in tried if t.polished is not None]
    best = max(fitted, key=lambda t: t.gain, default=None)
    if best is None or best.proposal.cause not in PASSED:
        return list(tried)
    first_of_all = max(tried, key=lambda t: t.gain)
    if not _is_at(first_of_all, best):
        return list(tried)
    leading = {best.proposal.location['side']: best}
    for one in sorted(fitted, key=lambda t: -t.gain):
        if is_other_side(one.proposal, best.proposal):
            leading.setdefault(one.proposal.location['side'], one)
    levels = {side: _quiet(_place_of(one)) for side, one in leading.items()}
    first = leading[min(levels, key=lambda side: levels[side])]
    most = {}
    for side, one in leading.items():
        nats = 0.5 * chance_of(_place_of(one), _place_of(first))
        behind = (levels[side] - _quiet(_place_of(first))) / (1.0 + pi / 8.0 * nats**2) ** 0.5
        most[side] = best.gain - behind

    def fair(one: Tried) -> Tried | None:
        side = one.proposal.location.get('side')
        if not _is_at(one, best) or side not in most:
            return one
        # a side that was fitted is told by its best fit alone
        return replace(one, gain=most[side]) if one is leading[side] else None

    return [kept for one in tried if (kept := fair(one)) is not None]


def _is_at(one: Tried, other: Tried) -> bool:
    """Tell whether both are of one cause at one place, on whichever side."""
    is_like = one.proposal.cause == other.proposal.cause
    return is_like and is_beside(one.proposal, other.proposal)


def _place_of(tried: Tried) -> Beside:
    assert tried.polished is not None
    return tried.polished.place


def _quiet(place: Beside) -> float:
    return place.stage.judged(place.fitted)


def chance_of(one: Beside, other: Beside) -> float:
    """Return the standard deviation of a difference of quiet channels' chi squared, by where along travel it came about.

    As of two models of which neither is quite true (Vuong 1989, Likelihood ratio tests for model selection and
    non-nested hypotheses, Econometrica 57), from sums over blocks that overlap (Kuensch 1989, The jackknife and the
    bootstrap for general stationary observations, Annals of Statistics 17). A step passes a place with both axles, a
    pitch apart, and once a loop: what the twin's law is off by there repeats. Blocks are two pitches long, and loops
    are added up.
    """
    here, there = one.stage.observation, other.stage.observation
    frame = here.frame
    common, *rows = np.intersect1d(here.index, there.index, return_indices=True)
    left = [
        np.sum((in_time(p)[at] ** 2)[:, p.stage.quiet], axis=1)
        for p, at in zip((one, other), rows, strict=True)
    ]
    differs = np.bincount(common % frame.n_loop, left[0] - left[1], frame.n_loop)
    block = 2 * frame.per_pitch
    summed = np.cumsum(np.concatenate([[0.0], differs, differs[:block]]))
    blocks = summed[block:] - summed[:-block]
    return float(np.sum(blocks[:-1] ** 2) / block) ** 0.5
