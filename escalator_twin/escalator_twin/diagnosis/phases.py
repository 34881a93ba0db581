"""Phases of what goes round: in every recording another."""

from dataclasses import replace
from math import atan2

import numpy as np

from escalator_twin.diagnosis.context import Beside
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.regression import inner_products, inverse
from escalator_twin.diagnosis.settling import TREADS

QUARTER = np.pi / 2.0
ROUND = 'roller_eccentricity'  # of a sine alone: by two runs its phase is known


def rolled_here(place: Beside, effect: Proposal) -> Proposal:
    """Return a tread's effect with the phase that it has here: a matter of how rollers stood."""
    if effect.cause not in TREADS:
        return effect
    stage, columns = place.stage, []
    for phase in (0.0, QUARTER):
        run = stage.run((with_phase(effect, phase).deviation,))
        columns.append(run - place.model)
    white = stage.columns(np.stack(columns, axis=2), effect.cause)
    right, gram = inner_products(place.fitted, white)
    c, d = inverse(gram) @ right
    return with_phase(effect, atan2(d, c))


def with_phase(effect: Proposal, phase: float) -> Proposal:
    return replace(effect, parameters={**effect.parameters, 'phase_rad': float(phase)})
