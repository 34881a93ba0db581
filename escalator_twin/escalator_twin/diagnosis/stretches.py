"""Where a stretch of drag begins and ends: looked for with the twin before its numbers are fitted.

Rollers stand a pitch apart, so that a stretch that ends half a pitch further brakes about as much: the
ends have a best value in every pitch, and a fit keeps the one that it begins in.
"""

from dataclasses import replace

import numpy as np

from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.regression import Fitted, score_each
from escalator_twin.diagnosis.stage import Stage
from escalator_twin.errors import EscalatorError
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
    tried: list[Proposal] = []
    for first in SHARES:
        for last in SHARES:
            s_from = float(np.clip(start + first * pitch, 0.0, length))
            s_to = float(np.clip(end + last * pitch, 0.0, length))
            if s_to - s_from < SHORTEST_M:
                continue
            location: dict[str, object] = {'s_from_m': s_from, 's_to_m': s_to}
            force = max(work / (s_to - s_from), 1.0)
            one = replace(proposal, location=location, parameters={'force_N': force})
            try:
                change = (stage.run((one.deviation,)) - base) / force
            except EscalatorError:
                continue
            score = score_each(fitted, stage.columns(change[:, :, None], one.cause))
            size, gain = float(score.size[0]), float(score.gain[0])
            if size > 0.0:
                tried.append(replace(one, parameters={'force_N': size}, gain=gain))
    return max(tried, key=lambda p: p.gain, default=proposal)
