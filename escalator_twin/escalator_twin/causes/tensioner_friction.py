"""Dry friction on the tensioner carriage.

Law
---
Coulomb friction that saturates with speed as the rollers' does, added to the dry friction that
the machine already has,

    F = -force_N tanh(u' / 2 mm/s)

What it changes: the tensioner's motion is clipped at its turning points, and the tension of its
four strands together jumps by twice ``force_N`` whenever the carriage turns, twice a pitch.

Limits
------
No sticking (under a steady force below ``force_N`` the carriage creeps), no Stribeck effect, no
dependence on place. The creep speed is read from the labelled recording: with the tolerances
fitted beside it, 2 to 3 mm/s leave 14 % less of the squared residual than sticking friction does,
and find 149 to 155 N where the label says 150; sticking finds 144 N and wants a damper half as
strong again as designed.

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
    free_bodies=True,
)
