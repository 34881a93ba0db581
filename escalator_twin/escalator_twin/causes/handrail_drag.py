"""The handrail drags on its guides.

Law
---
Dry drag of ``force_N`` in all, shared evenly by the handrail's bodies, each along its own axis and
against its motion, saturating as tanh(v / 2 mm/s). The torque at the driving pulley rises by
force_N times its radius; the tension rises evenly along the loop up to the pulley.

Limits
------
Even along the loop; no sticking.

Alike
-----
None among the causes of the steps.
"""

from dataclasses import replace

import numpy as np

from escalator_twin.causes.base import Cause, Location, Parameter, Theta
from escalator_twin.errors import MachineError
from escalator_twin.machine import MultibodyMachine
from escalator_twin.physics.multibody.layout import Layout


def alter_layout(layout: Layout, machine: MultibodyMachine, _: Location, theta: Theta) -> Layout:
    """Return free bodies with drag along the whole handrail."""
    rail = layout.handrail
    if rail is None:
        raise MachineError(f'{machine.source}: handrail_drag: the machine has no handrail')
    network = layout.network
    rows, points = network.point_rows[layout.first_rail_point], 2 * len(rail.network.mass)
    row = [float(rows[0]), float(rows[1]), -1.0, np.inf, theta['force_N'] / points]
    stretches = np.concatenate([network.stretch_drag, [row]])
    return replace(layout, network=network._replace(stretch_drag=stretches))


CAUSE = Cause(
    name='handrail_drag',
    law='dry drag along the whole handrail',
    parameters=(Parameter('force_N', 'N', 0.0, 3000.0, neutral=0.0, tolerance=10.0),),
    places=(),
    references=({'force_N': 150.0},),
    acts_on=('handrail_tension', 'handrail_torque', 'handrail_speed'),
    locked_to=('time',),
    alter_layout=alter_layout,
)
