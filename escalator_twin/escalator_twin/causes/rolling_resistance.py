"""All rollers roll harder, or easier, than designed.

Law
---
Drag of each roller = factor mu |N| tanh(v / creep_speed) + viscous part; N its normal force.

Limits
------
One factor for all rollers, all speeds; the viscous part stays.

Alike
-----
``friction_speed`` at one speed (the same law there), ``guide_drag`` along a very long stretch,
``tensioner_preload`` in part.
"""

from dataclasses import replace

from escalator_twin.causes.base import Cause, Location, Parameter, Theta
from escalator_twin.machine import Machine


def alter_machine(machine: Machine, _: Location, theta: Theta) -> Machine:
    """Return ``machine`` with its rolling resistance scaled."""
    resistance = machine.roller.rolling_resistance * theta['factor']
    return replace(machine, roller=replace(machine.roller, rolling_resistance=resistance))


CAUSE = Cause(
    name='rolling_resistance',
    law='rolling resistance of all rollers times factor',
    parameters=(Parameter('factor', '-', 0.0, 20.0, neutral=1.0, tolerance=0.1),),
    places=(),
    references=({'factor': 1.6}, {'factor': 0.6}),
    acts_on=('link_force', 'carriage_displacement', 'step_acceleration', 'roller_normal_force'),
    locked_to=('guide', 'load'),
    alike=('friction_speed', 'tensioner_preload'),
    alter_machine=alter_machine,
    free_bodies=True,
)
