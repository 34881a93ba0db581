"""Look for the frequency of a bouncing frame with the twin itself.

The chain strikes the frame with multiples of the pitch's frequency, and the frame answers with these
alone: between two of them a frequency is told by how strong each line is, which the force on a rigid
frame says too little of.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np

from escalator_twin.causes.registry import KNOWN
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.regression import Fitted
from escalator_twin.diagnosis.scan import best_as_run, scored
from escalator_twin.diagnosis.stage import Stage
from escalator_twin.signals import Floats

LOWEST_HZ, HIGHEST_HZ, RATIO = 2.5, 16.0, 1.025
RUN = 6  # of the frequencies that explain most
# About the best, the three numbers are turned together: along a valley, since a line is as strong
# beside a heavy frame's frequency as further from a light one's. No slopes: rollers rattle.
SPACING = {'frequency_hz': 1.02, 'modal_mass_kg': 1.25, 'damping_ratio': 1.5}
PARTS = (1.0, 0.6, 0.3)


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
