"""What a good machine may have by itself: where that accounts for a remainder, nothing is unexplained.

contracts.md gives every cause a tolerance, also those that no number of the data sheet stands for: a wave of the
drive, a roller, a step. Up to three of them are no effect and get no name, but they are in the data.
"""

from dataclasses import replace

from escalator_twin.diagnosis.context import Context
from escalator_twin.diagnosis.free import freed, of_machine
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.tried import Tried
from escalator_twin.diagnosis.unexplained import excess_of, look, Unexplained
from escalator_twin.diagnosis.verdict import EFFECT_TOLERANCES, size_in_tolerances, Weighed
from escalator_twin.diagnosis.walked import Bench, Round, Walked

# Of chi squared above a good machine's: what accounts for less leaves more than a good machine has.
LEAST = 0.5
MOST = 2  # that are fitted
UNFITTED = 4.0  # tolerances: what is proposed with more is seldom within three once it is fitted


def within_tolerance(
    context: Context, walked: Walked, rest: Unexplained, bench: Bench, jobs: int = 1
) -> tuple[Walked, Unexplained]:
    """Return what stays open beside what a good machine may have, and the walk with that as a candidate.

    Both as they were where nothing within tolerance accounts for all that is open.

    Parameters
    ----------
    context : Context
    walked : Walked
    rest : Unexplained
    bench : Bench
        Of the machine's kind.
    jobs : int
        Simulations at a time.
    """
    if not rest.significant or walked.last is None:
        return walked, rest
    best = largest_within(walked.last, bench, jobs)
    if best is None or best.polished is None:
        return walked, rest
    before = bench.bare(walked.before, [found.proposal for found in walked.found])
    beside = look(context, before, freed(best.polished.place, walked.last.known))
    if beside.significant:
        return walked, rest
    size = f'{best.proposal.cause}, {size_in_tolerances(best.proposal):.1f} tolerances'
    beside = replace(beside, signature={'within_tolerance': size})
    row = Weighed(best.proposal, best.gain, -float('inf'), 0.0)
    others = [w for w in walked.weighed if w.proposal is not best.proposal]
    weighed = sorted((row, *others), key=lambda w: -w.probability)  # the likeliest stays first
    return replace(walked, weighed=tuple(weighed)), beside


def largest_within(last: Round, bench: Bench, jobs: int) -> Tried | None:
    """Return what accounts for most of what is open and is no effect, fitted; None where nothing does for half."""
    least = LEAST * excess_of(last.place, last.context.floor)
    rows = [t for t in last.tried if t.gain >= least and _is_within(t.proposal, EFFECT_TOLERANCES)]
    if not any(t.polished for t in rows):
        chosen = [
            p for p in last.proposals if p.gain >= least and _is_within(p, UNFITTED)
        ]  # best first
        if not chosen:
            return None
        tried = bench.attempt(last.context, last.place, last.known, chosen[:MOST], jobs)
        rows = [t for t in tried if t.gain >= least and _is_within(t.proposal, EFFECT_TOLERANCES)]
    return max((t for t in rows if t.polished), key=lambda t: t.gain, default=None)


def _is_within(proposal: Proposal, tolerances: float) -> bool:
    """Tell whether it is no larger than some tolerances, and none that is tuned in any case."""
    if proposal.nuisance is not None or not of_machine(proposal):
        return False
    return size_in_tolerances(proposal) < tolerances
