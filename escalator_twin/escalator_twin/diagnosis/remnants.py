"""Earlier effects that a later one of the same cause turns out to account for.

The strongest comes first, but what is strongest may be another place's form of what is there: a blow on
the left of an axle as one on its right. Once the right place is accepted beside it, little of the first
is left; it keeps some of the later one's law's error, and so stays more than its tolerance.
"""

from collections.abc import Sequence
from dataclasses import replace

from escalator_twin.diagnosis.found import Found, SHARE_OF_KIN
from escalator_twin.diagnosis.verdict import neutral_of


def without_remnants(found: Sequence[Found]) -> list[Found]:
    """Return effects without the earlier ones that are no more than a later one's law may leave.

    Parameters
    ----------
    found : sequence of Found
        In the order of their acceptance, with the numbers of a fit that held them all.

    Returns
    -------
    kept : list of Found
        The last one of a cause with what it explains in an earlier one's place.
    """
    kept = list(found)
    k = 0
    while k < len(kept):
        one = kept[k]
        at = next((j for j in range(k + 1, len(kept)) if is_remnant(one, kept[j])), None)
        if at is None:
            k += 1
            continue
        later = kept[at]
        kept[at] = replace(later, gain=later.gain + one.gain - alone(one))
        del kept[k]
    return kept


def is_remnant(one: Found, later: Found) -> bool:
    """Tell whether an effect is no more than what a later one of the same cause may leave.

    The same is asked of a later effect beside an earlier one, see `is_left_over`.
    """
    if one.proposal.cause != later.proposal.cause or not _has_spread(one):
        return False
    return alone(one) < SHARE_OF_KIN * later.gain


def alone(one: Found) -> float:
    """Return by how much chi squared rises if an effect is taken out and the others are fitted again.

    In a fit that holds them all that is the square of its standard deviations away from none.
    """
    key = one.proposal.fitted[0]
    away = one.proposal.parameters[key] - neutral_of(one.proposal.cause, key)
    return (away / one.sd[key]) ** 2


def _has_spread(one: Found) -> bool:
    return bool(one.proposal.fitted) and one.sd.get(one.proposal.fitted[0], 0.0) > 0.0
