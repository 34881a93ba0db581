"""Where a stretch of drag begins and ends: looked for with the twin before its numbers are fitted.

Rollers stand a pitch apart, so that a stretch that ends half a pitch further brakes about as much: the
ends have a best value in every pitch, and a fit keeps the one that it begins in.
"""

from dataclasses import replace

from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.refine import on_path
from escalator_twin.diagnosis.regression import Fitted
from escalator_twin.diagnosis.scan import best_variant
from escalator_twin.diagnosis.stage import Stage
from escalator_twin.signals import Floats

# Frequencies up to which is compared, and shares of a pitch by which each end is moved then: where
# a roller meets the drag, the chain is shaken, and waves of 12 Hz at 0.25 m/s are 20 mm long.
LEVELS = ((4.0, (1.0, 0.5, 0.25)), (8.0, (0.12, 0.06)), (None, (0.03, 0.015)))
SHORTEST_M = 0.3


def best_stretch(
    stage: Stage, base: Floats, fitted: Fitted, proposal: Proposal, jobs: int = 1
) -> Proposal:
    """Return the proposal with the ends that explain most.

    Parameters
    ----------
    stage, base, fitted, jobs
        As of `scan.scored`.
    proposal : Proposal
        A drag between ``s_from_m`` and ``s_to_m``.
    """
    found = proposal
    for cut_hz, shares in LEVELS:
        level = stage.up_to(cut_hz)
        left = fitted if cut_hz is None else level.fit(base)
        for share in shares:
            variants = _around(stage, found, share * stage.observation.frame.pitch_m)
            found = best_variant(level, base, left, variants, jobs) or found
    return found


def _around(stage: Stage, proposal: Proposal, way_m: float) -> list[Proposal]:
    """Return the stretch with each end here, and moved forth and back, doing the same work."""
    length = stage.machine_length
    start, end = (float(str(proposal.location[key])) for key in ('s_from_m', 's_to_m'))
    work = proposal.parameters['force_N'] * (end - start)
    variants = []
    for first in (-way_m, 0.0, way_m):
        for last in (-way_m, 0.0, way_m):
            s_from = on_path(start + first, length)
            s_to = on_path(end + last, length)
            if s_to - s_from < SHORTEST_M:
                continue
            location: dict[str, object] = {'s_from_m': s_from, 's_to_m': s_to}
            force = max(work / (s_to - s_from), 1.0)
            variants.append(replace(proposal, location=location, parameters={'force_N': force}))
    return variants
