"""How far a size may be off to either side, where the twin's answer to it bends.

A spread by slopes is the same to both sides. A spring that is stiffer by four of them may explain as much
as by none: what the tolerances make up for on that side, slopes at the best place do not know.
"""

from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from escalator_twin.causes.application import apply
from escalator_twin.diagnosis.context import Beside, Context
from escalator_twin.diagnosis.found import Found
from escalator_twin.diagnosis.frames import possible_frequencies
from escalator_twin.diagnosis.free import of_machine, without_own
from escalator_twin.diagnosis.loops import LOCAL
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.refine import changed
from escalator_twin.diagnosis.stage import Stage
from escalator_twin.diagnosis.verdict import NORMAL_95
from escalator_twin.errors import EscalatorError

FAR = (2.0, 4.0)  # standard deviations by slopes at which a size is tried
LEAST = 1.0  # rise of chi squared that is told from none
FRAME = 'truss_resonance', 'frequency_hz'  # of which there are several that do nearly the same
Reach = Mapping[str, tuple[float, float]]


def with_reach(
    context: Context, after: Beside, found: Sequence[Found], jobs: int = 1
) -> list[Found]:
    """Return effects with the spreads of their first numbers to either side, and of a frame's frequency.

    The tolerances are fitted beside every size that is tried, by slopes: chi squared can only be lower
    with more pains, so that a spread is never told too large by that. What effects of single links do to the
    model is kept as it is (`Stage.lean`): a run at length for each of a hundred frequencies took minutes.

    Parameters
    ----------
    context : Context
    after : Beside
        The machine with all effects.
    found : sequence of Found
        The effects, in the order in which they are told.
    jobs : int
        Simulations at a time.
    """
    if not any(_bends(one) or one.proposal.cause == FRAME[0] for one in found):
        return list(found)
    proposals = [one.proposal for one in found]
    stage = without_own(after.stage, proposals)
    before = stage.fit(after.model)
    lean = stage.lean(after.model)

    def beside(index: int, *trials: Proposal) -> Stage:
        others = [p for k, p in enumerate(proposals) if k != index and p.cause not in LOCAL]
        machine = apply(
            context.machine, tuple(p.deviation for p in (*others, *trials) if of_machine(p))
        )
        return replace(lean, machine=machine)

    def rise(index: int, by: float) -> float:
        one = found[index]
        key = one.proposal.fitted[0]
        values = {key: one.proposal.parameters[key] + by * one.sd[key]}
        trial = changed(one.proposal, values, stage.machine_length)
        try:
            model = beside(index, trial).run()
        except EscalatorError:
            return np.inf
        fitted = stage.fit_shifted(model, before)
        cause = one.proposal.cause
        return stage.judged(fitted, cause) - stage.judged(before, cause)

    tried = [
        (k, side * far)
        for k, one in enumerate(found)
        if _bends(one)
        for side in (-1.0, 1.0)
        for far in FAR
    ]
    with ThreadPoolExecutor(max(1, jobs)) as pool:
        rises = dict(zip(tried, pool.map(lambda t: rise(*t), tried), strict=True))
    reached = []
    for k, one in enumerate(found):
        reach: dict[str, tuple[float, float]] = {}
        if _bends(one):
            reach |= _reach(one, {by: r for (i, by), r in rises.items() if i == k})
        cause, key = FRAME
        if one.proposal.cause == cause:
            own = one.proposal.parameters[key]
            low, high = possible_frequencies(beside(k), before, one.proposal, jobs)
            low, high = min(low, *(one.near or (own,))), max(high, *(one.near or (own,)))
            below, above = (own - low) / NORMAL_95, (high - own) / NORMAL_95
            least = one.sd.get(key, 0.0)
            reach[key] = max(below, least), max(above, least)
        reached.append(replace(one, reach=reach) if reach else one)
    return reached


def _bends(found: Found) -> bool:
    """Tell whether an effect's answer may bend: one of the whole machine, which is quickly run."""
    proposal = found.proposal
    key = proposal.fitted[0] if proposal.fitted else ''
    is_number = key in proposal.parameters and found.sd.get(key, 0.0) > 0.0
    return of_machine(proposal) and proposal.cause not in LOCAL and is_number


def _reach(found: Found, rises: Mapping[float, float]) -> Reach:
    """Return the spread to either side, no less than by slopes: where chi squared rises by 1."""
    key = found.proposal.fitted[0]
    low, high = (
        _times([(far, rises[side * far]) for far in FAR]) * found.sd[key] for side in (-1.0, 1.0)
    )
    return {key: (low, high)}


def _times(rises: Sequence[tuple[float, float]]) -> float:
    """Return the spread in spreads by slopes, by how chi squared rises with these."""
    for far, rise in rises:
        if rise >= LEAST:
            return max(far / float(np.sqrt(rise)), 1.0)
    return FAR[-1]
