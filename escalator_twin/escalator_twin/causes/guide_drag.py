"""A stretch of the guide drags: dirt, a bent cover, a pinched channel.

Law
---
Every roller whose path coordinate lies in s_from_m to s_to_m has extra dry drag,
F = -force_N tanh(v / creep_speed), whatever its normal force. A stretch with s_from_m above
s_to_m runs through the seam of the loop.

Limits
------
Sharp ends: the force on a roller steps as it enters.

Alike
-----
``rolling_resistance`` where the stretch is most of the loop.
"""

import numpy as np

from escalator_twin.causes.base import Cause, Location, Parameter, Theta
from escalator_twin.causes.places import number, S_FROM, S_TO
from escalator_twin.machine import Machine
from escalator_twin.physics.parameters import Parameters, SIDES


def alter_parameters(
    parameters: Parameters, _machine: Machine, location: Location, theta: Theta
) -> Parameters:
    """Return ``parameters`` with one more stretch, in two rows where it holds the seam."""
    if theta['force_N'] == 0.0:
        return parameters
    start, end = number(location, 's_from_m'), number(location, 's_to_m')
    force = theta['force_N'] * len(SIDES) / parameters.n_sides  # a row holds all its ends
    rows = [[start, end, force]]
    if start > end:
        rows = [[start, parameters.length_m, force], [0.0, end, force]]
    return parameters._replace(guide_drag=np.vstack([parameters.guide_drag, rows]))


CAUSE = Cause(
    name='guide_drag',
    law='extra dry drag per roller in a stretch',
    parameters=(Parameter('force_N', 'N', 0.0, 1000.0, neutral=0.0, tolerance=3.0),),
    places=(S_FROM, S_TO),
    references=({'force_N': 50.0},),
    acts_on=('link_force', 'carriage_displacement', 'step_acceleration', 'roller_normal_force'),
    locked_to=('guide',),
    alike=('rolling_resistance',),
    alter_parameters=alter_parameters,
)
