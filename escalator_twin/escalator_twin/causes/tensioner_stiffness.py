"""The tensioner's spring is softer or stiffer than designed.

Law
---
Force on the carriage, outward positive, u the displacement from where the preload holds:

    F = preload - factor k u - c u'

Limits
------
A linear spring. The mean of u and of the tension change too, but zeros of instruments hide it.

Alike
-----
``tensioner_preload`` at a single experiment, as far as the mean tension sets the polygon's
elastic part; the ratio of tension ripple to carriage motion tells them apart.
"""

from dataclasses import replace

from escalator_twin.causes.base import Cause, Location, Parameter, Theta
from escalator_twin.machine import Machine


def alter_machine(machine: Machine, _: Location, theta: Theta) -> Machine:
    """Return ``machine`` with its tensioner's spring scaled."""
    stiffness = machine.tensioner.stiffness_n_m * theta['factor']
    return replace(machine, tensioner=replace(machine.tensioner, stiffness_n_m=stiffness))


CAUSE = Cause(
    name='tensioner_stiffness',
    law='the tensioner spring has factor times its stiffness',
    parameters=(Parameter('factor', '-', 0.05, 20.0, neutral=1.0, tolerance=0.02),),
    places=(),
    references=({'factor': 0.7}, {'factor': 1.4}),
    acts_on=('carriage_displacement', 'link_force', 'step_acceleration', 'roller_normal_force'),
    locked_to=('travel',),
    alike=('tensioner_preload',),
    alter_machine=alter_machine,
    free_bodies=True,
)
