"""Weigh what was refined: every cause and place against all others and against none.

Evidence is half the fall of chi squared, its variances multiplied by a temperature: the twin's
error is not noise of its own in every sample. A cause that only
uses up what a good machine may have is none: its size counts in tolerances.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp, inf, log

import numpy as np
from scipy.stats import chi2, norm

from escalator_twin.causes.registry import KNOWN
from escalator_twin.diagnosis.proposals import Proposal

# What one more free number of a cause costs, nats: half the logarithm of the ratio of its prior
# range to its interval, some e^6.
PER_NUMBER = 3.0
EFFECT_TOLERANCES = 3.0  # contracts.md: an effect is more than three of them
TOLERANCE_DOUBT = 0.7  # tolerances: what the fit of one tolerance is off by through the others
# Causes whose tolerance changes nothing that another one's does; what thermal drift hides of a creep is in
# its interval.
BY_ITSELF = ('gauge_drift',)
PRIOR_EFFECT = 5.0  # nats that speak for a good machine before anything was seen
# The same where a cause stands for a tolerance, whose prior has its say already: at four tolerances
# an effect is likelier than not, at three it is not.
PRIOR_BEYOND = 4.0
# Times the reference from which a size is no longer this cause's: contracts.md lets bars hold at the
# reference and asks for a third of it; twice is the most that the generator draws.
FAR_SIZE = 3.0
# Times the nearest reference below which a size is less than bars are told for: a third, measured a tenth too small.
SLIGHT_SIZE = 0.3
FAR_OUT = 300.0  # a square that no good instrument comes near, however many numbers it has
LAW_ERROR = 0.02  # of a size: what the twin's law is off by, one standard deviation
ALIKE = 3.0  # nats within which two causes cannot be told apart
NORMAL_95 = 1.96  # standard deviations to either side of a 95 % interval


@dataclass(frozen=True)
class Weighed:
    """A candidate and its share of belief.

    Attributes
    ----------
    proposal : Proposal
    gain : float
        Fall of chi squared.
    evidence : float
        Nats against no cause.
    probability : float
    """

    proposal: Proposal
    gain: float
    evidence: float
    probability: float


def neutral_of(cause: str, key: str) -> float:
    """Return what a number of a cause is where the cause is not there; 0 where nothing is told."""
    neutral = next((p.neutral for p in KNOWN[cause].parameters if p.name == key), None)
    return neutral if neutral is not None and np.isfinite(neutral) else 0.0


def size_in_tolerances(proposal: Proposal) -> float:
    """Return how many tolerances a proposal's size is from neutral; infinity without one."""
    total, known = 0.0, False
    for parameter in KNOWN[proposal.cause].sizes:
        if parameter.tolerance is None or parameter.neutral is None:
            continue
        if parameter.name in proposal.parameters:
            known = True
            way = proposal.parameters[parameter.name] - parameter.neutral
            if (proposal.cause, parameter.name) in RATIOS:
                way = log(max(proposal.parameters[parameter.name], 1e-3))
            total += (way / parameter.tolerance) ** 2
    return total**0.5 if known else inf


def size_in_references(proposal: Proposal) -> float:
    """Return how many times the largest reference of its cause a proposal's size is; 0 without one.

    Factors count by their logarithm or as they are, whichever is more: a spring 2.3 times as stiff is
    130 % away, where a reference of 0.7 is 30 %.
    """
    cause = KNOWN[proposal.cause]
    times = [0.0]
    for parameter in cause.sizes:
        name, neutral = parameter.name, parameter.neutral
        if neutral is None or not np.isfinite(neutral) or name not in proposal.parameters:
            continue
        references = [row[name] for row in cause.references if name in row]
        sizes = np.array([proposal.parameters[name], *references], float)
        measures = [sizes - neutral]
        if name == 'factor':  # a load factor of 0 is an empty step: no ratio
            measures.append(np.log(np.maximum(sizes, 1e-3) / neutral))
        times += [
            float(abs(ways[0]) / np.abs(ways[1:]).max()) for ways in measures if np.any(ways[1:])
        ]
    return max(times)


def size_in_nearest(proposal: Proposal) -> float:
    """Return how many times the reference to its side of neutral a proposal's size is; infinity without one."""
    cause = KNOWN[proposal.cause]
    times = []
    for parameter in cause.sizes:
        name, neutral = parameter.name, parameter.neutral
        if neutral is None or not np.isfinite(neutral) or name not in proposal.parameters:
            continue
        way = proposal.parameters[name] - neutral
        ways = [row[name] - neutral for row in cause.references if name in row]
        ways = [w for w in ways if w * way > 0.0] or [w for w in ways if w]
        if ways:
            times.append(abs(way) / min(map(abs, ways)))
    return max(times, default=inf)


RATIOS = {('drive_stiffness', 'factor'), ('link_stiffness', 'factor')}


def evidence_of(proposal: Proposal, gain: float, grown: float = 1.0) -> float:
    """Return nats for a proposal against a machine within tolerance.

    Parameters
    ----------
    proposal : Proposal
    gain : float
        Fall of chi squared.
    grown : float
        Times its size that the proposal is taken to have.
    """
    if gain <= 0.0:
        return -inf
    tolerances = grown * size_in_tolerances(proposal)
    if tolerances < EFFECT_TOLERANCES:
        return -inf
    spread = 1.0 / gain
    if proposal.nuisance and not KNOWN[proposal.cause].of_machine:
        # the gain is what the tolerance's own prior leaves: that counts once
        spread = 1.0 / _as_one(gain, max(len(proposal.fitted), 1))
        if proposal.cause not in BY_ITSELF:
            spread += (TOLERANCE_DOUBT / tolerances) ** 2
    elif np.isfinite(tolerances):
        doubt = TOLERANCE_DOUBT if proposal.nuisance else 0.0
        spread += (1.0 + doubt**2) / tolerances**2
    if proposal.nuisance:
        return 0.5 / spread - log(max(proposal.places, 1)) - PRIOR_BEYOND
    if proposal.draws is None:
        return 0.5 / spread - _cost(proposal) - PRIOR_EFFECT
    # The data choose place and numbers, and pay for it. That a good machine's own is so large is as unlikely
    # wherever it is: it would be at the place that the data choose.
    told, by_size = by_data(proposal, gain), 0.5 / spread - log(proposal.draws)
    return -float(np.logaddexp(-told, -by_size)) - PRIOR_EFFECT


def by_data(proposal: Proposal, gain: float) -> float:
    """Return nats for a proposal by chi squared alone, less what choosing its place and numbers costs."""
    return 0.5 * gain - _cost(proposal)


def _as_one(square: float, count: int) -> float:
    """Return the square of one normal number that is as seldom passed as the sum of several squares."""
    if count == 1 or square > FAR_OUT:
        return square
    return max(float(norm.isf(0.5 * chi2.sf(square, count))) ** 2, 1e-6)


def weigh(candidates: Sequence[tuple[Proposal, float]]) -> list[Weighed]:
    """Return candidates with their probabilities, best first.

    The best is weighed against none; all others against the best, by what chi squared says.

    Parameters
    ----------
    candidates : sequence of (proposal, gain)
    """
    rows = [(p, g, evidence_of(p, g)) for p, g in candidates]
    real = [row for row in rows if row[2] > -inf]
    if not real:
        return [Weighed(p, g, e, 0.0) for p, g, e in sorted(rows, key=lambda r: -r[1])]
    top = max(real, key=lambda row: by_data(row[0], row[1]))
    reference = by_data(top[0], top[1])
    logs = []
    for p, g, e in rows:
        beside = top[2] + by_data(p, g) - reference
        # Which of two it is, the data say: a size of ten tolerances is no less likely than one of eleven.
        # That a rival is an effect at all, and no good machine's, is counted by itself.
        own = 0.0 if p is top[0] else -float(np.logaddexp(0.0, -e))
        logs.append(beside + own)
    peak = max(0.0, *(value for value in logs if value > -inf))
    weights = [exp(max(value - peak, -700.0)) if value > -inf else 0.0 for value in logs]
    total = sum(weights) + exp(-peak)
    found = [
        Weighed(p, g, value, w / total)
        for (p, g, _), value, w in zip(rows, logs, weights, strict=True)
    ]
    return sorted(found, key=lambda w: (-w.probability, -w.gain))


def _cost(proposal: Proposal) -> float:
    return log(max(proposal.places, 1)) + PER_NUMBER * max(len(proposal.fitted), 1)
