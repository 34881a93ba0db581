r"""The accelerometer sits askew on its step.

Law
---
The sensor is turned in the step frame by the rotation vector r = (x_deg, y_deg, z_deg),
right-hand, in all (what tolerance it has is part of it). It reads the specific force f in its own
axes,

.. math:: f' = R(r)^T f \approx f - r \times f

y_deg mixes the gravity of z into x: -9.81 sin(y_deg) on a landing.

Limits
------
Rigid mounting; three axes of one sensor at one place. An axis that is not recorded counts as 0.

Alike
-----
None: rotation alone makes gravity on one axis look like acceleration on another.
"""

from dataclasses import replace

import numpy as np

from escalator_twin.causes.base import Cause, Location, Parameter, Theta
from escalator_twin.causes.imperfections import accelerometers, Imperfections, needed
from escalator_twin.machine import Machine
from escalator_twin.signals import read_only

AXES = ('x_deg', 'y_deg', 'z_deg')


def alter_imperfections(
    imperfections: Imperfections, machine: Machine, _: Location, theta: Theta
) -> Imperfections:
    """Return ``imperfections`` with every accelerometer turned by this much in all."""
    turn = read_only(np.deg2rad([theta[axis] for axis in AXES]))
    names = needed(accelerometers(machine), 'an accelerometer (quantity step_acceleration)')
    return replace(imperfections, rotations_rad=dict.fromkeys(names, turn))


CAUSE = Cause(
    name='accelerometer_misalignment',
    law='small right-hand rotations of the sensor in the step frame, in all',
    parameters=tuple(
        Parameter(axis, 'deg', -180.0, 180.0, neutral=0.0, tolerance=0.3, default=0.0)
        for axis in AXES
    ),
    places=(),
    references=(
        {'x_deg': 0.0, 'y_deg': 4.0, 'z_deg': 0.0},
        {'x_deg': 4.0, 'y_deg': 0.0, 'z_deg': 0.0},
        {'x_deg': 0.0, 'y_deg': 0.0, 'z_deg': 4.0},
    ),
    acts_on=('step_acceleration',),
    locked_to=('guide',),
    alter_imperfections=alter_imperfections,
)
