"""What a search proposes: a cause, where it may sit, about how large, and what it explains."""

from collections.abc import Container, Sequence
from dataclasses import dataclass, field, replace

from scipy.stats import chi2

from escalator_twin.machine import Deviation

SAME_M = 0.25  # of the guide: what contracts.md takes for the same place
SAME_LINKS = 2  # more or fewer, of a stretch of the chain


@dataclass(frozen=True)
class Proposal:
    """A cause at a place with its linear estimate.

    Attributes
    ----------
    cause : str
    location : mapping
    parameters : mapping of name to float
    gain : float
        By how much chi squared falls, by the linear estimate.
    sd : mapping of parameter to float
        Standard deviations by the same estimate.
    places : int
        Among how many places of the cause this one was chosen.
    fitted : tuple of str
        Parameters that a refinement fits, the one that sizes the effect first.
    draws : int, optional
        How many of the cause a good machine may have, each of a tolerance's size, wherever they are. Where
        it is not given, one at each of the places, and of each number that is fitted.
    """

    cause: str
    location: dict[str, object]
    parameters: dict[str, float]
    gain: float
    sd: dict[str, float] = field(default_factory=dict)
    places: int = 1
    fitted: tuple[str, ...] = ()
    nuisance: str | None = None
    draws: int | None = None

    @property
    def deviation(self) -> Deviation:
        """The proposal as part of a machine description."""
        return Deviation(self.cause, dict(self.parameters), dict(self.location))


def same_place(one: Proposal, other: Proposal) -> bool:
    """Tell whether two proposals are of one cause at one place, as far as places are told apart."""
    if one.cause != other.cause or one.location.keys() != other.location.keys():
        return False
    for key, value in one.location.items():
        there = other.location[key]
        if isinstance(value, float) and isinstance(there, float):
            if abs(value - there) > SAME_M:
                return False
        elif isinstance(value, list) and isinstance(there, list):
            if len(set(value) ^ set(there)) > SAME_LINKS:
                return False
        elif value != there:
            return False
    return True


def is_beside(one: Proposal, other: Proposal) -> bool:
    """Tell whether two proposals with a side sit at the same place but for that."""
    place = {**one.location, 'side': other.location['side']}
    return same_place(replace(one, location=place), other)


def is_other_side(one: Proposal, other: Proposal) -> bool:
    """Tell whether two proposals are of one cause at one place on different sides."""
    if one.cause != other.cause or one.location.get('side') == other.location.get('side'):
        return False
    return is_beside(one, other)


def false_fall(proposals: Sequence[Proposal], causes: Container[str]) -> float:
    """Return the largest fall by a part that no good machine has, over that of white noise.

    Parameters
    ----------
    proposals : sequence of Proposal
        For a good machine.
    causes : container of str
        Those at a place: good machines have a little of every other one.

    Returns
    -------
    ratio : float
        To the median of the largest of as many squared normal numbers; 0 without a proposal.
    """
    false = [p for p in proposals if p.cause in causes]
    if not false:
        return 0.0
    columns = sum({p.cause: p.places for p in false}.values())
    return max(p.gain for p in false) / float(chi2.ppf(0.5 ** (1.0 / columns), 1))
