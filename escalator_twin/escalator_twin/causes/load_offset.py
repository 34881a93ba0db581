"""The load sits to one side of the steps.

Law
---
Of every load, left_share weighs on the left side and the rest on the right; 0.5 is the middle.
The two chains then carry different tension on the incline: left minus right grows by
(2 left_share - 1) of the load's component along the path.

Limits
------
The same share on all steps. Nothing in an empty machine, nor in a planar model, which has no
sides.

Alike
-----
``gauge_gain`` of one link, which does not change sign between the runs and acts on every ripple.
"""

import numpy as np

from escalator_twin.causes.base import Cause, Location, Parameter, Theta
from escalator_twin.machine import Machine
from escalator_twin.physics.parameters import Parameters


def alter_parameters(
    parameters: Parameters, _machine: Machine, _: Location, theta: Theta
) -> Parameters:
    """Return ``parameters`` with the load shifted to a side."""
    if parameters.n_sides == 1:
        return parameters
    shares = 2.0 * np.array([[theta['left_share']], [1.0 - theta['left_share']]])
    return parameters._replace(load=parameters.load * shares)


CAUSE = Cause(
    name='load_offset',
    law='share of every load on the left side',
    parameters=(Parameter('left_share', '-', 0.0, 1.0, neutral=0.5, tolerance=0.005),),
    places=(),
    references=({'left_share': 0.6}, {'left_share': 0.4}),
    acts_on=('link_force', 'step_acceleration', 'carriage_displacement', 'roller_normal_force'),
    locked_to=('load', 'side'),
    alike=('gauge_gain',),
    alter_parameters=alter_parameters,
)
