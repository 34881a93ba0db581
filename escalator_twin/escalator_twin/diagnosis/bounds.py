"""What an effect may explain at most in a round of the walk, and what it has to."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

from escalator_twin.diagnosis.context import Beside
from escalator_twin.diagnosis.floor import Floor, SHAKING
from escalator_twin.diagnosis.found import Found, FURTHER, is_left_over
from escalator_twin.diagnosis.free import of_machine
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.unexplained import (
    excess_of,
    fell_by,
    is_open,
    is_stretched,
    is_used_up,
    LEAST_EXPLAINED,
)
from escalator_twin.diagnosis.verdict import by_data, evidence_of

HOPE = 3.0  # times the linear gain: what fitting may make of a proposal
FITTED = 2.0  # times the gain and the size of one run: what fitting it with the tolerances may make of them
# Times what is above a good machine's: what a further effect explains at most, noise that it fits with it.
BEYOND = 2.0


@dataclass(frozen=True)
class Bounds:
    """How much a recording holds, and how much of it was found.

    Attributes
    ----------
    found : tuple of Found
        The accepted effects.
    is_open : bool
        More than a good machine's is left.
    is_hidden : bool
        In a tolerance, or in an instrument's nuisance, more than a good one's: that is not in what is left.
    quiet, shaken : float
        Chi squared above a good machine's: in quiet channels, and where rattling shakes.
    fell : float
        Chi squared that was explained so far.
    further : int
        Effects that may be found after this round's.
    """

    found: tuple[Found, ...]
    is_open: bool
    is_hidden: bool
    quiet: float
    shaken: float
    fell: float
    further: int

    @classmethod
    def of(
        cls, before: Beside, place: Beside, floor: Floor, found: Sequence[Found], further: int
    ) -> 'Bounds':
        """Return the bounds of a machine with its accepted effects, ``before`` being the one without."""
        opened = is_open(place, floor)
        stood_for = {str(f.proposal.nuisance) for f in found}
        hidden = is_stretched(place) or (not opened and is_used_up(place, stood_for))
        quiet, shaken = (excess_of(place, floor, shaken) for shaken in (False, True))
        return cls(tuple(found), opened, hidden, quiet, shaken, fell_by(before, place), further)

    def above(self, cause: str) -> float:
        """Return what is left above a good machine's in the channels that speak for a cause."""
        return self.quiet + (self.shaken if cause in SHAKING else 0.0)

    def most(self, cause: str = '') -> float:
        """Return what a further effect of the machine explains at most."""
        return inf if self.is_hidden else BEYOND * self.above(cause)

    def is_left_over(self, cause: str, gain: float) -> bool:
        """Tell whether an effect is no more than what an accepted law leaves; where nothing is open, it closes nothing."""
        return is_left_over(cause, gain, self.found, self.quiet if self.is_open else inf)

    def is_in_vain(self, cause: str, gain: float) -> bool:
        """Tell whether this round's best and all that may follow leave nearly all open.

        What follows explains no more than `FURTHER` times this round's best, which comes first for being the
        strongest; names that leave so much open are not told. Of an instrument's fault nothing is said: what it
        explains is counted beside a good instrument.
        """
        if not all(of_machine(one.proposal) for one in self.found):
            return False
        total = self.fell + self.above(cause)
        return self.fell + (1.0 + FURTHER * self.further) * gain < LEAST_EXPLAINED * total

    def may_stand(self, proposal: Proposal) -> bool:
        """Tell whether a proposal may, fitted, be more than what the accepted laws leave."""
        gain = HOPE * proposal.gain
        if of_machine(proposal):
            gain = min(gain, self.most(proposal.cause))
        return not self.is_left_over(proposal.cause, gain)

    def is_worth_fitting(self, proposal: Proposal, gain: float, rival: float = -inf) -> bool:
        """Tell whether an effect that was run once may, fitted with all else, still be named in this round.

        Parameters
        ----------
        proposal : Proposal
        gain : float
            Of the run.
        rival : float
            Nats that the data say for a fault of the measurement: what cannot come to more is sought again beside it.
        """
        cause, fitted = proposal.cause, FITTED * gain
        if self.is_in_vain(cause, fitted) or self.is_left_over(cause, fitted):
            return False
        # what stands for a tolerance is far more once that is tuned beside it
        if proposal.nuisance is not None:
            return True
        return by_data(proposal, fitted) >= rival and evidence_of(proposal, fitted, FITTED) > 0.0
