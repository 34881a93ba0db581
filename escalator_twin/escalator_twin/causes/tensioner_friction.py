"""Dry friction on the tensioner carriage.

Law
---
Coulomb friction, set-valued: the carriage sticks while the other forces on it stay below
``force_N``, and slides against that force else,

    F = -force_N sign(u')          sliding
    |F| <= force_N                 sticking, u' = 0

added to the dry friction that the machine already has. What it changes: the tensioner's motion
is clipped at its turning points, and the chain tension jumps by ``force_N`` (both sides
together) whenever the carriage turns, once or twice a pitch.

Limits
------
No Stribeck effect, no dependence on the carriage's place. A law that is smooth over 1 to 3 mm/s
fits the one labelled recording as well.

Alike
-----
``tensioner_stop`` where the stop is met for a short part of the motion only.
"""

from dataclasses import replace

from escalator_twin.causes.base import Cause, Location, Parameter, Theta
from escalator_twin.machine import Machine


def alter_machine(machine: Machine, _: Location, theta: Theta) -> Machine:
    """Return ``machine`` with more dry friction on its carriage."""
    force = machine.tensioner.dry_friction_n + theta['force_N']
    return replace(machine, tensioner=replace(machine.tensioner, dry_friction_n=force))


CAUSE = Cause(
    name='tensioner_friction',
    law='dry friction on the carriage, opposing its motion',
    parameters=(Parameter('force_N', 'N', 0.0, 3000.0, neutral=0.0, tolerance=10.0),),
    places=(),
    references=({'force_N': 150.0},),
    acts_on=('carriage_displacement', 'link_force', 'step_acceleration', 'roller_normal_force'),
    locked_to=('travel',),
    alike=('tensioner_stop',),
    alter_machine=alter_machine,
)
