"""What several recordings leave in one form, or one of them names alone.

In one recording, what little an accepted effect leaves may be its own law's error. That error has no
reason to look like one other effect of one size at other speeds, loads and preloads: what does is
suggested to the recordings that are searched next, and named where they have it as well.
"""

from collections.abc import Sequence

from escalator_twin.diagnosis.campaign import LEAST_PART, pooled, SURE_SD, union_of
from escalator_twin.diagnosis.conclusion import NAMED
from escalator_twin.diagnosis.diagnose import Diagnosis
from escalator_twin.diagnosis.found import Found
from escalator_twin.diagnosis.free import of_machine
from escalator_twin.diagnosis.proposals import Proposal, same_place
from escalator_twin.diagnosis.scouts import may_begin_with
from escalator_twin.diagnosis.telling import alternatives
from escalator_twin.diagnosis.verdict import LAW_ERROR, neutral_of

# Of what the strongest effect explains: a law that is off by so many of its standard deviations.
BEYOND_LAW = (SURE_SD * LAW_ERROR) ** 2


def repeated_by(scouts: Sequence[Diagnosis]) -> list[Proposal]:
    """Return the effect that all searches leave at one place and of one size, if there is one.

    Parameters
    ----------
    scouts : sequence of Diagnosis
        Searched with nothing suggested.

    Returns
    -------
    effects : list of Proposal
        None or one, with the numbers of all.
    """
    rows = [scout.left for scout in scouts if scout.left is not None]
    if len(rows) < max(len(scouts), 2):
        return []
    first = rows[0].proposal
    if not of_machine(first) or not first.fitted or 'phase_rad' in first.parameters:
        return []
    if not all(same_place(first, row.proposal) for row in rows):
        return []
    if not all(_is_beyond(row, scout) for row, scout in zip(rows, scouts, strict=True)):
        return []
    joint = pooled([(row.proposal, row.sd) for row in rows]).proposal
    key = first.fitted[0]
    neutral = neutral_of(first.cause, key)
    mean = joint.parameters[key] - neutral
    # as products: of two sizes that are each other's opposite the mean is none
    ways = [(row.proposal.parameters[key] - neutral) * mean for row in rows]
    square = mean * mean
    return [joint] if all(LEAST_PART * square < w < square / LEAST_PART for w in ways) else []


def perhaps_of(scouts: Sequence[Diagnosis]) -> list[Proposal]:
    """Return what one search names beside what all do, all others naming that alone.

    What is small shows in one recording and not in another. Nothing where two name different things, since one of
    them is wrong; nothing that the one may have taken for something else.

    Parameters
    ----------
    scouts : sequence of Diagnosis
        Searched with nothing suggested.
    """
    groups = union_of(scouts)
    more = [group[0] for group in groups if len(group) < len(scouts)]
    if len(more) == len(groups):
        return []
    effects = [found.proposal for found, _ in more]
    named = [[e for e in effects if names_all(scout, [e])] for scout in scouts]
    if sorted(len(some) for some in named)[-2:] != [0, len(effects)]:
        return []
    sure = [found for found, _ in more if set(alternatives(found)) <= {'friction_speed'}]
    return [found.proposal for found in sure if may_begin_with(found.proposal)]


def names_all(scout: Diagnosis, effects: Sequence[Proposal]) -> bool:
    """Tell whether a search names all of some effects."""
    named = [found.proposal for found, probability in scout.found if probability >= NAMED]
    return all(any(same_place(effect, one) for one in named) for effect in effects)


def _is_beyond(left: Found, scout: Diagnosis) -> bool:
    """Tell whether an effect explains more than the errors of the laws of all that were accepted."""
    return all(left.gain >= BEYOND_LAW * found.gain for found, _ in scout.found)
