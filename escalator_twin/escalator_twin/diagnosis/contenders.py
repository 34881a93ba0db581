"""Which proposals are worth a simulation, and what is weighed once they were run."""

from collections.abc import Sequence

from escalator_twin.diagnosis.bounds import HOPE
from escalator_twin.diagnosis.floor import PASSED
from escalator_twin.diagnosis.found import ONE_GAUGE
from escalator_twin.diagnosis.free import of_machine
from escalator_twin.diagnosis.proposals import is_beside, Proposal, same_place
from escalator_twin.diagnosis.search import WORTH
from escalator_twin.diagnosis.tried import Tried
from escalator_twin.diagnosis.verdict import evidence_of, size_in_tolerances, Weighed

CONTENDERS = 4  # proposals that are simulated in a round
OF_ONE_CAUSE = 2
LEAST_GAIN = 25.0  # of chi squared: below it nothing is simulated
ACCEPT = 0.5  # probability from which an effect is accepted and taken out before the next round


def is_unrun(top: Weighed, tried: Sequence[Tried]) -> bool:
    """Tell whether the twin was never run with an effect of the machine that would be accepted."""
    if top.probability < ACCEPT or not of_machine(top.proposal):
        return False
    return not any(t.proposal is top.proposal for t in tried)


def is_known_fault(proposal: Proposal, known: Sequence[Proposal]) -> bool:
    """Tell whether a fault of the measurement is known already: what it leaves is its own law's error."""
    return not of_machine(proposal) and any(same_place(proposal, other) for other in known)


def is_hopeless(proposal: Proposal, proposals: Sequence[Proposal]) -> bool:
    """Tell whether one gauge's fault explains more than fitting can make of a proposal."""
    best = max((p.gain for p in one_gauge(proposals)), default=0.0)
    return HOPE * proposal.gain < best and proposal.nuisance is None


def one_gauge(proposals: Sequence[Proposal]) -> list[Proposal]:
    """Return the faults of one gauge that are effects."""
    return [p for p in proposals if p.cause in ONE_GAUGE and evidence_of(p, p.gain) > 0.0]


def choose(proposals: Sequence[Proposal]) -> list[Proposal]:
    """Return the proposals that are worth a simulation, best first."""
    machine = [p for p in proposals if of_machine(p)]
    if not machine:
        return []
    least = max(LEAST_GAIN, WORTH * machine[0].gain)
    chosen: list[Proposal] = []
    for proposal in machine:
        if len(chosen) == CONTENDERS or (proposal.gain < least and not proposal.nuisance):
            continue
        if proposal.nuisance and size_in_tolerances(proposal) < 2.0:
            continue
        kin = [p for p in chosen if p.cause == proposal.cause]
        if len(kin) < OF_ONE_CAUSE or _is_at_one_of(proposal, kin):
            chosen.append(proposal)
    return chosen


def _is_at_one_of(proposal: Proposal, kin: Sequence[Proposal]) -> bool:
    """Tell whether a rail's step is at the place of another, where it may as well have this side or height."""
    return proposal.cause in PASSED and any(is_beside(p, proposal) for p in kin)


def candidates(
    proposals: Sequence[Proposal], tried: Sequence[Tried]
) -> list[tuple[Proposal, float]]:
    """Return what is weighed: simulated gains, and linear ones of what was not simulated."""
    done = {(r.proposal.cause, place_of(r.proposal)) for r in tried}
    rows: list[tuple[Proposal, float]] = []
    for row in tried:
        # one cause at one place, fitted from two starts, is one candidate: the better fit
        if not any(same_place(row.proposal, kept) for kept, _ in rows):
            rows.append((row.proposal, row.gain))
    cap = max((r.gain for r in tried), default=0.0)
    for proposal in proposals:
        if (proposal.cause, place_of(proposal)) in done:
            continue
        if of_machine(proposal):
            # not simulated: nothing that was proposed as less is believed to be more
            if evidence_of(proposal, proposal.gain) > 0.0 and proposal.gain < cap:
                rows.append((proposal, proposal.gain))
        else:
            rows.append((proposal, proposal.gain))
    return rows


def place_of(proposal: Proposal) -> str:
    return ', '.join(f'{k}={v}' for k, v in sorted(proposal.location.items()) if k != 's_m')
