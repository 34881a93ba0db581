"""One link is softer (or stiffer) than the others: a cracked plate, a loose pin.

Law
---
Link force = factor k (length - pitch) + c rate, for one link of one side. Under the same force
the link is longer by T / k (1 / factor - 1); the other side and the racking springs take a share.

Limits
------
Linear, no play. The gauge's section is not the cracked one: its calibration holds.

Alike
-----
``link_elongation`` of the same link where the tension varies little over the loop.
"""

from escalator_twin.causes.base import Cause, Location, Parameter, Theta
from escalator_twin.causes.places import integer, LINK, SIDE, text
from escalator_twin.causes.sides import rows_of
from escalator_twin.machine import Machine
from escalator_twin.physics.parameters import Parameters, SIDES


def alter_parameters(
    parameters: Parameters, _machine: Machine, location: Location, theta: Theta
) -> Parameters:
    """Return ``parameters`` with one link of one side scaled in stiffness."""
    stiffness = parameters.link_stiffness.copy()
    share = len(stiffness) / len(SIDES)  # of a row that stands for both sides
    for row in rows_of(text(location, 'side'), len(stiffness)):
        stiffness[row, integer(location, 'link')] *= 1.0 + share * (theta['factor'] - 1.0)
    return parameters._replace(link_stiffness=stiffness)


CAUSE = Cause(
    name='link_stiffness',
    law='one link of one side has factor times the stiffness',
    parameters=(Parameter('factor', '-', 0.02, 50.0, neutral=1.0, tolerance=0.05),),
    places=(LINK, SIDE),
    references=({'factor': 0.3},),
    acts_on=('link_force', 'carriage_displacement', 'step_acceleration', 'roller_normal_force'),
    locked_to=('link', 'side'),
    alike=('link_elongation',),
    alter_parameters=alter_parameters,
)
