"""The drive's spring is softer or stiffer: worn dogs, a loose rack.

Law
---
Each engaged axle end is pulled towards its dog by factor k (dog - axle) and the unchanged damper.
The load that the drive carries (lifting, drag) then stretches it more: the chain lags by
F / (factor k n), n the axle ends engaged, and steps back as axles come in and go out.

Limits
------
All dogs alike, no play.

Alike
-----
Little else acts on engagement alone; weak where the drive carries little.
"""

from dataclasses import replace

from escalator_twin.causes.base import Cause, Location, Parameter, Theta
from escalator_twin.machine import Machine


def alter_machine(machine: Machine, _: Location, theta: Theta) -> Machine:
    """Return ``machine`` with its drive's spring scaled."""
    stiffness = machine.drive.stiffness_n_m * theta['factor']
    return replace(machine, drive=replace(machine.drive, stiffness_n_m=stiffness))


CAUSE = Cause(
    name='drive_stiffness',
    law="the drive's spring has factor times its stiffness",
    parameters=(Parameter('factor', '-', 0.02, 50.0, neutral=1.0, tolerance=0.1),),
    places=(),
    references=({'factor': 0.25},),
    acts_on=('link_force', 'step_acceleration', 'carriage_displacement', 'roller_normal_force'),
    locked_to=('travel', 'guide'),
    alter_machine=alter_machine,
)
