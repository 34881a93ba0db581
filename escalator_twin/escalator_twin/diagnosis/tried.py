"""What the twin was run with: a proposal with its fitted numbers, and what it explains."""

from dataclasses import dataclass

from escalator_twin.diagnosis.polish import Polished
from escalator_twin.diagnosis.proposals import Proposal


@dataclass(frozen=True)
class Tried:
    """A proposal that the twin was run with.

    Attributes
    ----------
    proposal : Proposal
        With the fitted numbers.
    gain : float
        Fall of chi squared, in the channels that the cause acts on.
    sd : mapping of parameter to float
    polished : Polished or None
        Where it was fitted together with the tolerances and the known effects, these first.
    near : (float, float) or None
        Lowest and highest frequency of a frame that fits nearly as well, Hz, see `frequencies`.
    falls : (float, float) or None
        Of what was run and not fitted: the fall of chi squared in the channels that no rattling shakes, and
        in the others.
    """

    proposal: Proposal
    gain: float
    sd: dict[str, float]
    polished: Polished | None = None
    near: tuple[float, float] | None = None
    falls: tuple[float, float] | None = None
