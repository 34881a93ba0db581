"""Effects that are one number of the machine, found in two parts.

A large change is fitted from where its tolerances lead, which may end in a hollow of them. From the machine
as described the rest of it is found once more as an effect of its own: a preload of 0.73 as 0.82 and 0.89.
"""

from collections.abc import Sequence
from dataclasses import replace

from escalator_twin.diagnosis.accepted import placed_at
from escalator_twin.diagnosis.found import Found
from escalator_twin.diagnosis.free import of_machine
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.verdict import neutral_of


def told_once(found: Sequence[Found]) -> list[Found]:
    """Return effects with the last one put into an earlier one that is the same number of the machine.

    Parameters
    ----------
    found : sequence of Found
        In the order of their acceptance.

    Returns
    -------
    found : list of Found
        All of them where the last one is none of the others'; their sizes are to be fitted again otherwise.
    """
    *earlier, last = found
    at = next((k for k, f in enumerate(earlier) if is_same(f.proposal, last.proposal)), None)
    if at is None:
        return list(found)
    one = earlier[at]
    key = one.proposal.fitted[0]
    size, more = (p.parameters[key] for p in (one.proposal, last.proposal))
    whole = size * more if key == 'factor' else size + more - neutral_of(one.proposal.cause, key)
    effect = replace(one.proposal, parameters={**one.proposal.parameters, key: whole})
    earlier[at] = replace(placed_at(one, effect), gain=one.gain + last.gain)
    return earlier


def is_same(one: Proposal, other: Proposal) -> bool:
    """Tell whether two effects of the machine are parts of one number of it."""
    if not of_machine(one) or (one.cause, one.location) != (other.cause, other.location):
        return False
    return len(one.fitted) == 1 and one.fitted == other.fitted
