"""Look for the frequency of a bouncing frame with the twin itself.

The chain strikes the frame with multiples of the pitch's frequency, and the frame answers with these
alone: between two of them a frequency is told by how strong each line is, which the force on a rigid
frame says too little of.
"""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import product

import numpy as np

from escalator_twin.causes.registry import KNOWN
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.regression import Fitted, score_each
from escalator_twin.diagnosis.scan import best_as_run, scored
from escalator_twin.diagnosis.stage import Stage
from escalator_twin.errors import EscalatorError
from escalator_twin.signals import Floats

LOWEST_HZ, HIGHEST_HZ, RATIO = 2.5, 16.0, 1.025
RUN = 6  # of the frequencies that explain most
# About the best, the three numbers are turned together: along a valley, since a line is as strong
# beside a heavy frame's frequency as further from a light one's. No slopes: rollers rattle.
SPACING = {'frequency_hz': 1.02, 'modal_mass_kg': 1.25, 'damping_ratio': 1.5}
PARTS = (1.0, 0.6, 0.3)
# Of chi squared, and of what a frame explains: another frequency that leaves no more than either above the best may
# be the frame's. Rattling rollers alone move two neighbours' chi squared by the first, or by more where they
# rattle more: twice as much as chi squared changes by where tolerances are turned by next to nothing, up to half of
# what the frame explains.
NEARLY, NEARLY_SHARE, MOST_NEARLY = 50.0, 0.15, 0.5
NEXT_TO_NOTHING = 0.05  # standard deviations


def best_frame(
    stage: Stage, base: Floats, fitted: Fitted, proposal: Proposal, jobs: int = 1
) -> Proposal:
    """Return a bouncing frame of the frequency and damping that explain most.

    Parameters
    ----------
    stage, base, fitted, jobs
        As of `scan.scored`.
    proposal : Proposal
        Of a bouncing frame.
    """
    reference = KNOWN[proposal.cause].references[0]
    count = int(np.log(HIGHEST_HZ / LOWEST_HZ) / np.log(RATIO)) + 1

    every = [
        replace(proposal, parameters={**reference, 'frequency_hz': LOWEST_HZ * RATIO**k})
        for k in range(count)
    ]
    best = best_as_run(stage, fitted, scored(stage, base, fitted, every, jobs)[:RUN], jobs)
    if best is None:
        return proposal
    for part in PARTS:
        best = best_as_run(stage, fitted, [best, *_about(best, part)], jobs) or best
    return best


def _about(proposal: Proposal, part: float) -> Iterator[Proposal]:
    """Return the frames about one, at a part of the widest spacing."""
    ways = product(*([-part, 0.0, part] for _ in SPACING))
    for way in ways:
        factors = {key: SPACING[key] ** z for key, z in zip(SPACING, way, strict=True)}
        numbers = {key: proposal.parameters[key] * factors[key] for key in SPACING}
        if any(way):
            yield replace(proposal, parameters={**proposal.parameters, **numbers})


def possible_frequencies(
    stage: Stage, before: Fitted, proposal: Proposal, jobs: int = 1
) -> tuple[float, float]:
    """Return the lowest and the highest frequency with which a frame explains nearly as much, Hz.

    Chi squared about the best says how well that line's strength is known, and nothing of the hollows beyond the next
    multiple of the pitch's frequency. Of a frame that is far off a line, damping is not known: with the usual one another
    frequency may do as well.

    Parameters
    ----------
    stage : Stage
        The machine with all that is known but the frame.
    before : Fitted
        What the machine with the frame leaves.
    proposal : Proposal
        The frame, with its fitted numbers.
    jobs : int
        Simulations at a time.
    """
    cause, own = proposal.cause, proposal.parameters['frequency_hz']
    rigid = stage.run()
    fitted = stage.fit_shifted(rigid, before)
    level = stage.judged(before, cause)
    explained = stage.judged(fitted, cause) - level
    scatter = min(2.0 * rattling(stage, before, proposal, jobs), MOST_NEARLY * explained)
    most = max(NEARLY, NEARLY_SHARE * explained, scatter)

    usual = KNOWN[cause].references[0]['damping_ratio']
    dampings = (proposal.parameters['damping_ratio'], usual)

    def is_possible(frequency: float) -> bool:
        return any(is_possible_with(frequency, damping) for damping in dampings)

    def is_possible_with(frequency: float, damping: float) -> bool:
        numbers = {**proposal.parameters, 'frequency_hz': frequency, 'damping_ratio': damping}
        for _ in range(2):  # a frame's mass is known beside its own frequency alone
            one = replace(proposal, parameters=numbers)
            try:
                model = stage.run((one.deviation,))
            except EscalatorError:
                return False
            if stage.judged(stage.fit_shifted(model, before), cause) - level <= most:
                return True
            change = stage.columns((model - rigid)[:, :, None], cause)
            share = float(score_each(fitted, change).size[0])
            if share <= 0.0:
                return False
            numbers = {**numbers, 'modal_mass_kg': numbers['modal_mass_kg'] / share}
        return False

    lowest, highest = min(own, LOWEST_HZ), max(own, HIGHEST_HZ)
    down, up = (int(abs(np.log(own / end)) / np.log(RATIO)) for end in (lowest, highest))
    others = [own * RATIO**k for k in range(-down, up + 1) if k]
    with ThreadPoolExecutor(max(1, jobs)) as pool:
        able = list(pool.map(is_possible, others))
    near = [own, *(f for f, can in zip(others, able, strict=True) if can)]
    return min(near), max(near)


def rattling(stage: Stage, before: Fitted, proposal: Proposal, jobs: int = 1) -> float:
    """Return by how much chi squared changes where a tolerance is turned by next to nothing.

    Slow and empty, rollers rattle in their clearance, and a landing 0.05 mm longer makes other blows of a step.
    The mean over all tolerances, either way. Parameters are those of `possible_frequencies`.
    """
    level = stage.judged(before, proposal.cause)

    def change(way: tuple[str, float]) -> float:
        name, by = way
        turned = {**stage.turned, name: stage.turned.get(name, 0.0) + by}
        nearly = replace(stage, turned=turned)
        model = nearly.run((proposal.deviation,))
        return nearly.judged(nearly.fit_shifted(model, before), proposal.cause) - level

    ways = [(knob.name, z) for knob in stage.knobs for z in (-NEXT_TO_NOTHING, NEXT_TO_NOTHING)]
    with ThreadPoolExecutor(max(1, jobs)) as pool:
        changes = np.array(list(pool.map(change, ways)))
    return float(np.mean(np.abs(changes))) if len(changes) else 0.0
