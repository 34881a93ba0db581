"""The preload is not the one that the experiment asked for.

Law
---
Force on the carriage, outward positive: F = factor preload - k u - c u'. Two strands on each of
two sides hold it: the tension of each shifts by a quarter of (factor - 1) preload less what the
spring takes back, (factor - 1) preload / 4 - k (change of u) / 4.

Limits
------
The shift of the mean is hidden by the zeros of the gauges. What remains: rolling resistance
grows with the normal force that tension makes in curves, contact and links are compressed more.

Alike
-----
``tensioner_stiffness``, ``rolling_resistance`` in a single experiment.
"""

from escalator_twin.causes.base import Cause, Location, Parameter, Theta
from escalator_twin.causes.bodies import with_column
from escalator_twin.machine import Machine, MultibodyMachine
from escalator_twin.physics.multibody import network as net
from escalator_twin.physics.multibody.layout import Layout
from escalator_twin.physics.parameters import Parameters


def alter_parameters(
    parameters: Parameters, _machine: Machine, _: Location, theta: Theta
) -> Parameters:
    """Return ``parameters`` with the preload scaled."""
    return parameters._replace(preload=parameters.preload * theta['factor'])


def alter_layout(layout: Layout, _machine: MultibodyMachine, _: Location, theta: Theta) -> Layout:
    """Return free bodies with the lower gear's preload scaled."""
    return with_column(layout, 'part', 0, net.P_PUSH, 0.0, theta['factor'])


CAUSE = Cause(
    name='tensioner_preload',
    law="the preload is factor times the experiment's",
    parameters=(Parameter('factor', '-', 0.1, 5.0, neutral=1.0, tolerance=0.02),),
    places=(),
    references=({'factor': 0.8}, {'factor': 1.25}),
    acts_on=('carriage_displacement', 'link_force', 'step_acceleration', 'roller_normal_force'),
    locked_to=('travel', 'guide'),
    alike=('tensioner_stiffness', 'rolling_resistance'),
    alter_parameters=alter_parameters,
    alter_layout=alter_layout,
)
