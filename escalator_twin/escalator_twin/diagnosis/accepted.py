"""What a round accepts, and its numbers once more was fitted beside it."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from escalator_twin.diagnosis.contenders import ACCEPT, place_of
from escalator_twin.diagnosis.context import Beside, Context, quiet_chi2
from escalator_twin.diagnosis.found import Found
from escalator_twin.diagnosis.polish import Polished
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.tried import Tried
from escalator_twin.diagnosis.verdict import Weighed


def match_of(top: Weighed, tried: Sequence[Tried]) -> Tried | None:
    """Return the fit of what leads, None where it was not fitted."""
    return next((t for t in tried if t.proposal is top.proposal), None)


def found_of(weighed: Sequence[Weighed], match: Tried | None) -> Found:
    """Return the best of what was weighed, with what its own fit says of it where it was fitted."""
    top = weighed[0]
    sd = match.sd if match is not None else dict(top.proposal.sd)
    near = match.near if match is not None else None
    return Found(top.proposal, top.probability, sd, top.gain, tuple(weighed), near=near)


def left_of(weighed: Sequence[Weighed], tried: Sequence[Tried]) -> Found | None:
    """Return the best of what was weighed where it would be an effect, were it alone."""
    if not weighed or weighed[0].probability < ACCEPT:
        return None
    return found_of(weighed, match_of(weighed[0], tried))


def placed_at(one: Found, effect: Proposal) -> Found:
    """Return what was found with its effect as another proposal has it."""
    own = one.proposal
    rivals = (replace(r, proposal=effect) if r.proposal is own else r for r in one.rivals)
    return replace(one, proposal=effect, rivals=tuple(rivals))


def refitted(found: Sequence[Found], polished: Polished) -> list[Found]:
    """Return effects with the numbers of a fit that held them all."""
    rows = list(zip(polished.effects, polished.sd, strict=True))
    again = []
    for one in found:
        own = one.proposal
        # in the order in which they were found: two waves have the same cause and no place
        at = next(
            (
                k
                for k, (e, _) in enumerate(rows)
                if (e.cause, place_of(e)) == (own.cause, place_of(own))
            ),
            None,
        )
        if at is not None:
            effect, sd = rows.pop(at)
            one = replace(placed_at(one, effect), sd=sd)
        again.append(one)
    return again


def regrouped_found(
    regroup: Callable[[Context, Beside, Sequence[Proposal], int], list[Proposal] | None],
    again: Callable[[Context, Beside, Sequence[Proposal], int], Polished],
    polished: Polished,
    start: Sequence[Proposal],
    found: Sequence[Found],
    jobs: int = 1,
) -> tuple[Polished, list[Found]] | None:
    """Return effects at other places that explain more together; None where there are none.

    Parameters
    ----------
    regroup, again : callable
        See `walked.Bench`.
    polished : Polished
        The machine with all effects.
    start : sequence of Proposal
        Effects that were known before anything was sought.
    found : sequence of Found
    jobs : int
        Simulations at a time.
    """
    context, place = polished.context, polished.place
    effects = regroup(context, place, [*start, *(f.proposal for f in found)], jobs)
    if effects is None or effects[: len(start)] != list(start):
        return None
    other = again(context, place, effects, jobs)
    if quiet_chi2(other.place) >= quiet_chi2(place):
        return None
    rows = zip(found, effects[len(start) :], strict=True)
    return other, refitted([placed_at(one, effect) for one, effect in rows], other)
