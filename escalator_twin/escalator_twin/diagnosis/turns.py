"""Look for the angle of a roller's flat spot with the twin itself.

The spot is narrow, 20 deg, and what it does bends with its depth: by the responses alone it may come
out next to where it is, where no small step explains more.
"""

from dataclasses import replace

import numpy as np

from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.regression import Fitted
from escalator_twin.diagnosis.scan import best_variant
from escalator_twin.diagnosis.stage import Stage
from escalator_twin.signals import Floats

PHASES = tuple(0.12 * k for k in range(-6, 7))  # rad, beside the proposed one
SLIPS = (-2.4e-4, -1.2e-4, 1.2e-4, 2.4e-4)  # beside the proposed one


def best_turn(
    stage: Stage, base: Floats, fitted: Fitted, proposal: Proposal, jobs: int = 1
) -> Proposal:
    """Return a flat spot at the angle and with the slip that explain most.

    Parameters
    ----------
    stage, base, fitted, jobs
        As of `scan.scored`.
    proposal : Proposal
        Of a flat spot.
    """
    first = best_variant(
        stage, base, fitted, [_turned(proposal, way, 0.0) for way in PHASES], jobs
    )
    if first is None:
        return proposal
    # a slip turns the spot about where it is in the middle of the recording
    middle = stage.setting.experiment.direction * float(stage.observation.travel_m.mean())
    middle /= 0.5 * stage.machine.roller.diameter_m
    slipping = [_turned(first, -slip * middle, slip) for slip in SLIPS]
    return best_variant(stage, base, fitted, [first, *slipping], jobs) or first


def _turned(proposal: Proposal, way: float, slip: float) -> Proposal:
    parameters = dict(proposal.parameters)
    parameters['phase_rad'] = (parameters['phase_rad'] + way + np.pi) % (2.0 * np.pi) - np.pi
    parameters['slip'] = parameters.get('slip', 0.0) + slip
    return replace(proposal, parameters=parameters)
