"""What the walk asks of a kind of machine, and what it found in one recording."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from escalator_twin.diagnosis.context import Beside, Context
from escalator_twin.diagnosis.found import Found
from escalator_twin.diagnosis.further import Further
from escalator_twin.diagnosis.polish import Polished
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.tried import Tried
from escalator_twin.diagnosis.verdict import Weighed


@dataclass(frozen=True)
class Round:
    """The round that accepted nothing.

    Attributes
    ----------
    context : Context
    place : Beside
        The machine with all that is known.
    known : tuple of Proposal
    proposals : tuple of Proposal
        Best first.
    tried : tuple of Tried
        Of these, what the twin was run with.
    """

    context: Context
    place: Beside
    known: tuple[Proposal, ...]
    proposals: tuple[Proposal, ...]
    tried: tuple[Tried, ...] = ()


@dataclass(frozen=True)
class Walked:
    """What the walk found in one recording.

    Attributes
    ----------
    found : tuple of Found
        In the order of their acceptance.
    before, after : Beside
        The machine as described, and with the effects.
    weighed : tuple of Weighed
        The candidates of the last round, which accepted none.
    left : Found or None
        An effect of the last round that is no more than what an accepted law may leave.
    last : Round or None
        None where the walk ended with what it accepted.
    """

    found: tuple[Found, ...]
    before: Beside
    after: Beside
    weighed: tuple[Weighed, ...]
    left: Found | None = None
    last: Round | None = None
    stages: tuple[Beside, ...] = ()


@dataclass(frozen=True)
class Bench:
    """What the walk, and what follows it, ask of a kind of machine.

    Attributes
    ----------
    propose : callable
        Takes context, comparison and simulations at a time; returns proposals, best first.
    attempt : callable
        See `try_all`.
    again : callable
        Takes context, comparison, all known effects and simulations at a time; returns them fitted
        once more as far as they are of the machine, see `Polished`.
    bare : callable
        Takes a comparison and effects; returns the one that they are judged against.
    decide : callable
        See `decide_between`.
    begin : callable
        Takes a comparison and effects; returns the tolerances, standard deviations, from which
        what the effects gain is counted.
    nearer : callable, optional
        See `out_of_hollow`.
    regroup : callable, optional
        See `regrouped`.
    neighbours : callable, optional
        See `at_neighbours`.
    unevenness, is_scattered : callable, optional
        See `unevenness` and `is_scattered`.
    """

    propose: Callable[[Context, Beside, int], list[Proposal]]
    attempt: Callable[..., list[Tried]]
    again: Callable[[Context, Beside, Sequence[Proposal], int], Polished]
    bare: Callable[[Beside, Sequence[Proposal]], Beside]
    decide: Callable[[Context, Proposal, Proposal | None], Further | None]
    begin: Callable[[Beside, Sequence[Proposal]], Mapping[str, float]]
    nearer: Callable[[Context, Beside, Sequence[Proposal], Tried, int], Polished | None] | None = (
        None
    )
    regroup: Callable[[Context, Beside, Sequence[Proposal], int], list[Proposal] | None] | None = (
        None
    )
    neighbours: Callable[..., Polished] | None = None
    unevenness: Callable[[Context, Beside, Sequence[Proposal]], Mapping[int, float]] | None = None
    is_scattered: Callable[[Context, Beside, Sequence[Proposal]], bool] | None = None
