"""A gear's rim and seats run out of true.

Law
---
Rim and seats stand on a circle whose centre is ``amplitude_m`` off the shaft: at an angle a along
the sense of motion from where the chain meets the gear, with the gear turned by w, the rim stands
out by amplitude_m cos(a - w + phase_rad) and the seats are shifted along by
-amplitude_m sin(a - w + phase_rad). The chain's speed waves once per turn of the gear, and the
carriage follows what the chain takes up. The torque has what the rim's push does about the shaft.

Limits
------
Of the driven upper gear; the lower one slides and does not turn. Rail and rim hand a roller over
along the ramp along which flanks engage.

Alike
-----
None: nothing else repeats with the turns of the gear.
"""

from math import pi

from escalator_twin.causes.base import Cause, Location, Parameter, Theta
from escalator_twin.causes.bodies import with_column
from escalator_twin.causes.phases import PHASE
from escalator_twin.causes.places import LANDING
from escalator_twin.machine import MultibodyMachine
from escalator_twin.physics.multibody import network as net
from escalator_twin.physics.multibody.layout import Layout

LARGEST_M = 5e-3


def alter_layout(layout: Layout, _machine: MultibodyMachine, _: Location, theta: Theta) -> Layout:
    """Return free bodies with an eccentric upper gear."""
    layout = with_column(layout, 'rotor', 0, net.R_ECCENTRIC, theta['amplitude_m'])
    return with_column(layout, 'rotor', 0, net.R_PHASE, theta['phase_rad'] % (2.0 * pi))


CAUSE = Cause(
    name='gear_eccentricity',
    law='rim and seats of a gear run out of true, once per turn',
    parameters=(
        Parameter('amplitude_m', 'm', 0.0, LARGEST_M, neutral=0.0, tolerance=5e-5),
        PHASE,
    ),
    places=(LANDING,),
    references=({'amplitude_m': 1e-3},),
    acts_on=(
        'link_force', 'carriage_displacement', 'step_acceleration', 'roller_reaction',
        'gear_torque',
    ),
    locked_to=('travel',),
    alter_layout=alter_layout,
)  # fmt: skip
