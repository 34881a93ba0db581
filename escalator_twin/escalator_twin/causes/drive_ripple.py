r"""The drive's speed ripples with travel.

Law
---
Speed of the rack, x its travel since the recording's first sample, p the pitch:

.. math:: \frac{v}{\sqrt{1 - a^2}} (1 + a \sin(2 \pi c x / p + \varphi))

v = the mean speed over time, which a drive keeps, a = ``relative_amplitude``, c = ``cycles_per_pitch``.
The rack runs ahead and back by a p / (2 pi c), and the chain with it. What ripples with travel is longer where
it is slow: without the root a ripple of 2 % would run a millimetre late after five metres.

Limits
------
Small a; the ripple does not answer to load.

Alike
-----
``drive_hunting`` at one speed (frequency = c v / p). Its order of a whole number of cycles per
pitch is hidden under the polygon effect.
"""

import numpy as np

from escalator_twin.causes.base import Cause, Location, Parameter, Theta
from escalator_twin.causes.phases import PHASE
from escalator_twin.machine import Machine
from escalator_twin.physics.parameters import Parameters


def alter_parameters(
    parameters: Parameters, _machine: Machine, _: Location, theta: Theta
) -> Parameters:
    """Return ``parameters`` with one more ripple locked to travel."""
    if theta['relative_amplitude'] == 0.0:
        return parameters
    row = [theta['relative_amplitude'], theta['cycles_per_pitch'], theta['phase_rad']]
    return parameters._replace(ripple=np.vstack([parameters.ripple, row]))


CAUSE = Cause(
    name='drive_ripple',
    law='speed ripple locked to travel',
    parameters=(
        Parameter('relative_amplitude', '-', 0.0, 0.5, neutral=0.0, tolerance=0.001),
        Parameter('cycles_per_pitch', '1/pitch', 0.01, 50.0),
        PHASE,
    ),
    places=(),
    references=({'relative_amplitude': 0.02, 'cycles_per_pitch': 0.37},),
    acts_on=('step_acceleration', 'link_force', 'carriage_displacement', 'roller_normal_force'),
    locked_to=('travel',),
    alike=('drive_hunting',),
    alter_parameters=alter_parameters,
)
