"""Every link of a side, or of both, is longer: a worn chain.

Law
---
Unstretched link length = pitch + length_m for all links of ``side``. The loop closes with the
carriage further out by n length_m / 2 (both sides), the links meet the curves out of step with
the design, and the axles leave the drive's dogs by length_m more from pitch to pitch. On one
side only, the axles also stand askew and load the racking springs.

Limits
------
Even wear. The dogs of the rack stay one pitch apart.

Alike
-----
``landing_length`` (it also takes up length) where both sides are worn.
"""

from escalator_twin.causes.base import Cause, Location, Parameter, Theta
from escalator_twin.causes.bodies import chain_links, share_of, with_column
from escalator_twin.causes.places import SIDE_OR_BOTH, text
from escalator_twin.causes.sides import add_mean
from escalator_twin.machine import Machine, MultibodyMachine
from escalator_twin.physics.multibody import network as net
from escalator_twin.physics.multibody.layout import Layout
from escalator_twin.physics.parameters import Parameters


def alter_parameters(
    parameters: Parameters, _machine: Machine, location: Location, theta: Theta
) -> Parameters:
    """Return ``parameters`` with all links of the side longer."""
    length = add_mean(
        parameters.link_length, text(location, 'side'), slice(None), theta['length_m']
    )
    return parameters._replace(link_length=length)


def alter_layout(
    layout: Layout, _machine: MultibodyMachine, location: Location, theta: Theta
) -> Layout:
    """Return free bodies with all links of the chain longer, by the mean of both sides."""
    length = theta['length_m'] * share_of(text(location, 'side'))
    return with_column(layout, 'link', chain_links(layout), net.L_FREE, length)


CAUSE = Cause(
    name='chain_elongation',
    law='length added to every link of the side or sides',
    parameters=(Parameter('length_m', 'm', -0.002, 0.002, neutral=0.0, tolerance=5e-6),),
    places=(SIDE_OR_BOTH,),
    references=({'length_m': 1.5e-4},),
    acts_on=('carriage_displacement', 'link_force', 'step_acceleration', 'roller_normal_force'),
    locked_to=('travel', 'guide', 'side'),
    alike=('landing_length',),
    alter_parameters=alter_parameters,
    alter_layout=alter_layout,
)
