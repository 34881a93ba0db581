"""Some steps carry another load than the rest.

Law
---
The load of each of ``steps`` is load_factor times the experiment's; weight only, on the passenger
run. The chain tension below a step on the incline carries its weight's component along the path.

Limits
------
Nothing where the experiment has no load. Which of few neighbouring steps it is shows less
sharply than how much is missing in all.

Alike
-----
``step_mass`` of one step, on the passenger run only: step mass weighs on the return run too.
"""

import numpy as np

from escalator_twin.causes.base import Cause, Location, Parameter, Theta
from escalator_twin.causes.places import items, STEPS
from escalator_twin.machine import Machine
from escalator_twin.physics.parameters import Parameters


def alter_parameters(
    parameters: Parameters, _machine: Machine, location: Location, theta: Theta
) -> Parameters:
    """Return ``parameters`` with the load of some steps scaled."""
    steps = np.array(items(location, 'steps'), dtype=np.int64)
    load = parameters.load.copy()
    load[:, steps] *= theta['load_factor']
    return parameters._replace(load=load)


CAUSE = Cause(
    name='load_distribution',
    law='some steps carry load_factor times the load of the rest',
    parameters=(Parameter('load_factor', '-', 0.0, 20.0, neutral=1.0, tolerance=0.01),),
    places=(STEPS,),
    references=({'load_factor': 0.0}, {'load_factor': 1.8}),
    acts_on=('link_force', 'carriage_displacement', 'step_acceleration', 'roller_normal_force'),
    locked_to=('load', 'link'),
    alike=('step_mass',),
    alter_parameters=alter_parameters,
)
