"""Accepted effects, and what their laws may leave."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from escalator_twin.diagnosis.free import of_machine
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.unexplained import LEAST_EXPLAINED
from escalator_twin.diagnosis.verdict import LAW_ERROR, Weighed

# An accepted law is never quite the machine's: what it leaves looks like a smaller effect. A further
# effect must explain more than these shares of what the others did; more among causes that act
# through the same part, unless it explains most of what is left above a good machine's: what a law
# leaves has no other cause's form.
SHARE_OF_FIRST = 0.01
SHARE_OF_KIN = 0.3
CLOSES = 0.5
# Of the same: what closes nearly all of it is of that form, whatever part it acts through. A landing beside a stop closed
# 1.03 of it, and 0.3 % of what the stop explained (development).
CLOSES_ALL = 0.9
# Of what the others did: what such an effect, or one of other kin that closes most, explains at least, an amplitude of
# a law's own error; and of chi squared: a search is not worth less (time, not measured).
SHARE_OF_CLOSING = LAW_ERROR**2
LEAST_CLOSING = 300.0
# A further effect is taken to explain no more than so many times what was found. The strongest comes first,
# but it may be fitted in a hollow, and be found again where it belongs.
FURTHER = 8.0
# Rounds that accept an effect, by which the names must explain what names have to (`LEAST_EXPLAINED`).
ROUNDS_TO_EXPLAIN = 2
# What a law leaves is in all gauges, or in both of a link: one gauge alone is no leftover.
ONE_GAUGE = ('gauge_gain', 'gauge_drift')
# Nor is gravity's share of a step's axes, which a sensor that is turned has along the whole guide: what a tilt of
# some tolerances costs is little beside any strong effect.
OF_ITS_OWN = (*ONE_GAUGE, 'accelerometer_misalignment')
KIN = (
    frozenset({
        'tensioner_friction', 'tensioner_stop', 'tensioner_stiffness', 'tensioner_preload',
        'landing_length', 'chain_elongation', 'guide_drag', 'rolling_resistance',
    }),
    frozenset({'roller_eccentricity', 'roller_flat', 'guide_step'}),
    frozenset({'drive_ripple', 'drive_hunting', 'drive_stiffness'}),
    frozenset({'load_distribution', 'step_mass', 'load_offset', 'roller_drag', 'link_stiffness'}),
)  # fmt: skip


@dataclass(frozen=True)
class Found:
    """An accepted effect.

    Attributes
    ----------
    proposal : Proposal
        With the fitted numbers.
    probability : float
    sd : mapping of parameter to float
        By chi squared alone.
    gain : float
        Fall of chi squared.
    rivals : tuple of Weighed
        All that was weighed with it, best first.
    reach : mapping of parameter to (float, float)
        In the place of ``sd``, to lower and to higher values.
    near : (float, float) or None
        See `Tried`.
    """

    proposal: Proposal
    probability: float
    sd: dict[str, float]
    gain: float
    rivals: tuple[Weighed, ...]
    reach: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    near: tuple[float, float] | None = None


def is_left_over(cause: str, gain: float, found: Sequence[Found], excess: float) -> bool:
    """Tell whether a further effect is no more than what an accepted law leaves.

    Parameters
    ----------
    cause : str
    gain : float
        Fall of chi squared.
    found : sequence of Found
        The accepted effects.
    excess : float
        Chi squared above a good machine's, before the further effect.
    """
    if cause in OF_ITS_OWN:
        return False
    closes, closes_all = gain >= CLOSES * excess, gain >= CLOSES_ALL * excess
    for earlier in found:
        kin = any({cause, earlier.proposal.cause} <= group for group in KIN)
        kin = kin or cause == earlier.proposal.cause
        least = (SHARE_OF_KIN if kin and not closes else SHARE_OF_FIRST) * earlier.gain
        if closes_all or (closes and not kin):
            least = min(least, max(SHARE_OF_CLOSING * earlier.gain, LEAST_CLOSING))
        if gain < least:
            return True
    return False


def is_in_vain(found: Sequence[Found], explained: float, further: int, accepted: int = 1) -> bool:
    """Tell whether nothing will be named, whatever else there is.

    Names that leave nearly all open are not told (`settle`). Of an instrument's fault nothing is said:
    what it explains is counted beside a good instrument. What a first round accepts may be fitted in a
    hollow, or be none, and the second one finds what it is; what two rounds do not explain is of no known form.

    Parameters
    ----------
    found : sequence of Found
        The accepted effects.
    explained : float
        By them, see `explained_by`.
    further : int
        Effects that may still be found.
    accepted : int
        Rounds that accepted an effect, also one that was found again elsewhere.
    """
    if not found or not all(of_machine(one.proposal) for one in found):
        return False
    if accepted >= ROUNDS_TO_EXPLAIN:
        return explained < LEAST_EXPLAINED
    return (1.0 + FURTHER * further) * explained < LEAST_EXPLAINED
