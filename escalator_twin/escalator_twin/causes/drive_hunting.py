r"""The drive's speed hunts in time.

Law
---
Speed of the rack, t the time since the recording's first sample:

.. math:: v (1 + a \sin(2 \pi f t + \varphi))

a = ``relative_amplitude``, f = ``frequency_hz``, 0.1 Hz and above: slower is the wander that
every drive has.

Limits
------
One steady tone.

Alike
-----
``drive_ripple`` at one speed (cycles per pitch = f p / v).
"""

import numpy as np

from escalator_twin.causes.base import Cause, Location, Parameter, Theta
from escalator_twin.causes.phases import PHASE
from escalator_twin.machine import Machine
from escalator_twin.physics.parameters import Parameters


def alter_parameters(
    parameters: Parameters, _machine: Machine, _: Location, theta: Theta
) -> Parameters:
    """Return ``parameters`` with one more ripple locked to time."""
    if theta['relative_amplitude'] == 0.0:
        return parameters
    row = [theta['relative_amplitude'], theta['frequency_hz'], theta['phase_rad']]
    return parameters._replace(hunting=np.vstack([parameters.hunting, row]))


CAUSE = Cause(
    name='drive_hunting',
    law='speed ripple locked to time, 0.1 Hz and above',
    parameters=(
        Parameter('relative_amplitude', '-', 0.0, 0.5, neutral=0.0, tolerance=0.001),
        Parameter('frequency_hz', 'Hz', 0.1, 50.0),
        PHASE,
    ),
    places=(),
    references=({'relative_amplitude': 0.012, 'frequency_hz': 0.4},),
    acts_on=('step_acceleration', 'link_force', 'carriage_displacement', 'roller_normal_force'),
    locked_to=('time',),
    alike=('drive_ripple',),
    alter_parameters=alter_parameters,
)
