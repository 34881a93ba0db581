"""One link is longer than its pitch, on both sides.

Law
---
The unstretched length of link ``link`` is pitch + length_m on both sides; its pin bores have
worn. The polygon loses its symmetry from pitch to pitch: the carriage moves by length_m / 2 more
outward, and with an extra motion while this link passes a curve.

Limits
------
Static wear, no play: the force law stays linear.

Alike
-----
None at one place of the loop; over a loop it is the only cause that follows one link through
every curve on both sides.
"""

from escalator_twin.causes.base import Cause, Location, Parameter, Theta
from escalator_twin.causes.bodies import with_column
from escalator_twin.causes.places import BOTH, integer, LINK
from escalator_twin.causes.sides import add_mean
from escalator_twin.machine import Machine, MultibodyMachine
from escalator_twin.physics.multibody import network as net
from escalator_twin.physics.multibody.layout import Layout
from escalator_twin.physics.parameters import Parameters


def alter_parameters(
    parameters: Parameters, _machine: Machine, location: Location, theta: Theta
) -> Parameters:
    """Return ``parameters`` with one link longer on both sides."""
    length = add_mean(parameters.link_length, BOTH, integer(location, 'link'), theta['length_m'])
    return parameters._replace(link_length=length)


def alter_layout(
    layout: Layout, _machine: MultibodyMachine, location: Location, theta: Theta
) -> Layout:
    """Return free bodies with one link longer."""
    return with_column(layout, 'link', integer(location, 'link'), net.L_FREE, theta['length_m'])


CAUSE = Cause(
    name='link_elongation',
    law='length added to one link, both sides',
    parameters=(Parameter('length_m', 'm', -0.02, 0.02, neutral=0.0, tolerance=5e-5),),
    places=(LINK,),
    references=({'length_m': 3e-3},),
    acts_on=('carriage_displacement', 'link_force', 'step_acceleration', 'roller_normal_force'),
    locked_to=('link',),
    alter_parameters=alter_parameters,
    alter_layout=alter_layout,
)
