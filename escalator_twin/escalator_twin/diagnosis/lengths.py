"""Fit a length on from where it is far longer and far shorter.

A seventh of a chain's elongation moves its rollers by more than a millimetre along the guide, as a landing
within tolerance does. What is told too short then is fitted beside landings and stiffnesses that make up for
it, and every step from there leads back: two chains of 0.15 mm a link were told as 0.128 and 0.140 mm. So may a
landing's be that is fitted beside other effects: beside a stop, one of -6 mm was left at -3.7 mm with 600 of chi squared
more than at -4.3 mm, where the machine's own landings explain the rest (seed 9015, development).
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from escalator_twin.diagnosis.closing import closes, MOST_LEFT
from escalator_twin.diagnosis.context import Beside, Context
from escalator_twin.diagnosis.fitting import fitted_beside
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.refine import Refined
from escalator_twin.diagnosis.tried import Tried
from escalator_twin.diagnosis.unexplained import excess_of

CHAIN, LANDING = LENGTHS = ('chain_elongation', 'landing_length')
FAR_M = 1.2e-3  # of all links of a side together, or of a landing
NEAR = 0.1  # of that: a fit takes it by itself


def from_far(
    context: Context, place: Beside, known: Sequence[Proposal], tried: Tried, jobs: int = 1
) -> Tried:
    """Return a length's fit, or a better one from where it is turned far; the tolerances tuned anew.

    Where it explains little of what is open, others are to be found first. Nothing may be open in a chain's hollow:
    one held 900 of chi squared more than the hidden size, and passed for a good machine. A landing is turned
    where it leaves something open: time, not measured.

    Parameters
    ----------
    context : Context
        As the search has it.
    place : Beside
        The machine with the known effects.
    known : sequence of Proposal
        Accepted effects, of machine and measurement.
    tried : Tried
        The best of what was fitted.
    jobs : int
        Simulations at a time.
    """
    cause, polished = tried.proposal.cause, tried.polished
    if polished is None or cause not in LENGTHS:
        return tried
    above, left = (excess_of(p, context.floor) for p in (place, polished.place))
    if left >= MOST_LEFT * above or (cause == LANDING and closes(tried, context.floor)):
        return tried
    key = tried.proposal.fitted[0]
    size = tried.proposal.parameters[key]
    step = FAR_M / (context.machine.chain.n_links if cause == CHAIN else 1)

    def fit(to: float) -> Tried:
        turned = replace(tried.proposal, parameters={**tried.proposal.parameters, key: to})
        none = np.empty((len(place.fitted.white), 0), np.float32)
        start = Refined(turned, place.model, place.fitted, tried.gain, tried.sd, none, ())
        return fitted_beside(context, place, known, start, jobs=jobs)

    with ThreadPoolExecutor(max(1, jobs)) as pool:
        ways = [t for t in pool.map(fit, (size + step, size - step)) if t.polished is not None]
    ways.append(tried)
    there = _crest([(t.proposal.parameters[key], t.gain) for t in ways], step)
    if there is not None:
        ways.append(fit(there))
    return max(ways, key=lambda t: t.gain)


def _crest(ends: Sequence[tuple[float, float]], step: float) -> float | None:
    """Return the size at which the parabola through three fits explains most, where none of them ended near it.

    Parameters
    ----------
    ends : sequence of (size, gain)
    step : float
        By which sizes were turned: the crest is sought no farther from them.
    """
    sizes, gains = np.array(ends).T
    if len(ends) != 3 or np.min(np.diff(np.sort(sizes))) < NEAR * step:
        return None
    bend, slope, _ = np.polyfit((sizes - sizes[-1]) / step, gains, 2)
    if bend >= 0.0:
        return None
    crest = float(sizes[-1] - 0.5 * slope / bend * step)
    away = np.abs(sizes - crest).min()
    return crest if NEAR * step < away < step else None
