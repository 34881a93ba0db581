"""Where a stretch of drag begins and ends: looked for with the twin before its numbers are fitted.

Rollers stand a pitch apart, so that a stretch that ends half a pitch further brakes about as much: the
ends have a best value in every pitch, and a fit keeps the one that it begins in.
"""

from dataclasses import replace

import numpy as np

from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.regression import Fitted
from escalator_twin.diagnosis.scan import best_variant
from escalator_twin.diagnosis.stage import Stage
from escalator_twin.signals import Floats

SHARES = (-1.0, -0.5, 0.0, 0.5, 1.0)  # of a pitch, by which each end is moved
SHORTEST_M = 0.3


def best_stretch(stage: Stage, base: Floats, fitted: Fitted, proposal: Proposal) -> Proposal:
    """Return the proposal with the ends that explain most.

    Parameters
    ----------
    stage : Stage
    base : (n, c) float64
        Its model.
    fitted : Fitted
        What that leaves, with the nuisance.
    proposal : Proposal
        A drag between ``s_from_m`` and ``s_to_m``.
    """
    pitch, length = stage.observation.frame.pitch_m, stage.machine_length
    start, end = (float(str(proposal.location[key])) for key in ('s_from_m', 's_to_m'))
    work = proposal.parameters['force_N'] * (end - start)
    variants = []
    for first in SHARES:
        for last in SHARES:
            s_from = float(np.clip(start + first * pitch, 0.0, length))
            s_to = float(np.clip(end + last * pitch, 0.0, length))
            if s_to - s_from < SHORTEST_M:
                continue
            location: dict[str, object] = {'s_from_m': s_from, 's_to_m': s_to}
            force = max(work / (s_to - s_from), 1.0)
            variants.append(replace(proposal, location=location, parameters={'force_N': force}))
    return best_variant(stage, base, fitted, variants) or proposal
