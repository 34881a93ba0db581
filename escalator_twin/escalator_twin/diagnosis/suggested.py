"""What other recordings of a machine named, tried in one more before anything is sought there."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from escalator_twin.diagnosis.contenders import ACCEPT
from escalator_twin.diagnosis.context import Beside, Context
from escalator_twin.diagnosis.found import Found
from escalator_twin.diagnosis.phases import rolled_here
from escalator_twin.diagnosis.polish import Polished
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.verdict import neutral_of, weigh

# Of the size that another recording gave: an effect that is told otherwise here is not the one suggested. As far as
# the sizes of one effect are apart at most, see `campaign.LEAST_PART`.
ALIKE = (0.4, 2.5)

Again = Callable[[Context, Beside, Sequence[Proposal], int], Polished]


@dataclass(frozen=True)
class Suggested:
    """Effects of the machine that other recordings of it named.

    Attributes
    ----------
    sure : tuple of Proposal
        By all of them: where not all of these are effects here, nothing is kept.
    perhaps : tuple of Proposal
        By one of them, the others naming nothing that it does not: each is kept where it is an effect here.
    """

    sure: tuple[Proposal, ...] = ()
    perhaps: tuple[Proposal, ...] = ()


NOTHING = Suggested()


def begun(
    again: Again,
    context: Context,
    place: Beside,
    start: Sequence[Proposal],
    suggested: Suggested,
    jobs: int = 1,
) -> tuple[Polished, list[Found]] | None:
    """Fit what is suggested; return it as this recording itself has it, None where it does not.

    Parameters
    ----------
    again : callable
        See `walked.Bench`.
    context : Context
    place : Beside
        The machine without.
    start : sequence of Proposal
        Effects that are known already.
    suggested : Suggested
    jobs : int
        Simulations at a time.
    """
    sure, perhaps = suggested.sure, suggested.perhaps
    while sure or perhaps:
        asked = (*sure, *perhaps)
        begin = [rolled_here(place, effect) for effect in asked]
        polished = again(context, place, [*start, *begin], jobs)
        found = held(polished, len(start))
        if None not in found[: len(sure)]:
            kept = tuple(
                e
                for e, one in zip(perhaps, found[len(sure) :], strict=True)
                if one is not None and _is_alike(e, one.proposal)
            )
            if len(kept) == len(perhaps):
                return polished, [one for one in found if one is not None]
            perhaps = kept
        elif perhaps:  # they may have taken what the others explain
            perhaps = ()
        else:
            break
    return None


def held(polished: Polished, first: int = 0) -> list[Found | None]:
    """Return which effects, from the ``first`` on, a recording itself has.

    What one explains is taken from how many of its standard deviations it is away from none; of
    what this recording says nothing of there is no standard deviation, and it is not one here.
    """
    found: list[Found | None] = []
    rows = list(zip(polished.effects, polished.sd, strict=True))[first:]
    for effect, sd in rows:
        key, one = effect.fitted[0], None
        if sd.get(key):
            gain = ((effect.parameters[key] - neutral_of(effect.cause, key)) / sd[key]) ** 2
            (weighed,) = weigh([(effect, gain)])
            if weighed.probability >= ACCEPT:
                one = Found(effect, weighed.probability, sd, gain, (weighed,))
        found.append(one)
    return found


def _is_alike(there: Proposal, here: Proposal) -> bool:
    key = there.fitted[0]
    neutral = neutral_of(there.cause, key)
    ours, theirs = (e.parameters[key] - neutral for e in (here, there))
    low, high = ALIKE
    return low * theirs * theirs < ours * theirs < high * theirs * theirs
