"""One roller drags: a seized bearing.

Law
---
Extra dry drag on one axle end, independent of its normal force, saturating with speed as the
rolling resistance does: F = -force_N tanh(v / creep_speed). The chain tension of that side steps
by force_N across the axle, higher ahead of it in the sense of motion. A gauge sees it change by
force_N when its link, or the axle, passes the drive; the tensioner fixes the level.

Limits
------
The roller turns on: no flat spot grows. Racking springs carry a part to the other side.

Alike
-----
None: the step follows one axle round the loop.
"""

from escalator_twin.causes.base import Cause, Location, Parameter, Theta
from escalator_twin.causes.bodies import with_column
from escalator_twin.causes.places import AXLE, integer, SIDE, text
from escalator_twin.causes.sides import add_sum
from escalator_twin.machine import Machine, MultibodyMachine
from escalator_twin.physics.multibody import network as net
from escalator_twin.physics.multibody.layout import Layout
from escalator_twin.physics.parameters import Parameters


def alter_parameters(
    parameters: Parameters, _machine: Machine, location: Location, theta: Theta
) -> Parameters:
    """Return ``parameters`` with dry drag on one roller."""
    drag = add_sum(
        parameters.roller_drag, text(location, 'side'), integer(location, 'axle'), theta['force_N']
    )
    return parameters._replace(roller_drag=drag)


def alter_layout(
    layout: Layout, _machine: MultibodyMachine, location: Location, theta: Theta
) -> Layout:
    """Return free bodies with dry drag on one chain roller, whether it turns or not."""
    return with_column(layout, 'drag', integer(location, 'axle'), net.D_DRY, theta['force_N'])


CAUSE = Cause(
    name='roller_drag',
    law='extra dry drag of one roller',
    parameters=(Parameter('force_N', 'N', 0.0, 3000.0, neutral=0.0, tolerance=5.0),),
    places=(AXLE, SIDE),
    references=({'force_N': 120.0},),
    acts_on=('link_force', 'carriage_displacement', 'step_acceleration', 'roller_normal_force'),
    locked_to=('link', 'side'),
    alter_parameters=alter_parameters,
    alter_layout=alter_layout,
)
