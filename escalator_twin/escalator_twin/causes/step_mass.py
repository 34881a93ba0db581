"""One step is heavier or lighter.

Law
---
Step ``step`` is rigid with link ``step``: delta_kg is shared evenly by its two axles, and on each
by the two sides. It has weight and inertia, on both runs.

Limits
------
A point mass in the middle of the step; no turning inertia of the step.

Alike
-----
``load_distribution`` of that step in a loaded machine, which weighs on the passenger run only.
"""

from escalator_twin.causes.base import Cause, Location, Parameter, Theta
from escalator_twin.causes.places import BOTH, integer, STEP
from escalator_twin.causes.sides import add_sum
from escalator_twin.machine import Machine
from escalator_twin.physics.parameters import Parameters

ENDS = 4  # two axles, two sides


def alter_parameters(
    parameters: Parameters, machine: Machine, location: Location, theta: Theta
) -> Parameters:
    """Return ``parameters`` with one step heavier."""
    first = integer(location, 'step')
    mass = parameters.end_mass
    for axle in (first, (first + 1) % machine.chain.n_links):
        mass = add_sum(mass, BOTH, axle, theta['delta_kg'] / ENDS)
    return parameters._replace(end_mass=mass)


CAUSE = Cause(
    name='step_mass',
    law='one step heavier or lighter',
    parameters=(Parameter('delta_kg', 'kg', -20.0, 500.0, neutral=0.0, tolerance=0.3),),
    places=(STEP,),
    references=({'delta_kg': 18.0},),
    acts_on=('link_force', 'carriage_displacement', 'step_acceleration', 'roller_normal_force'),
    locked_to=('link',),
    alike=('load_distribution',),
    alter_parameters=alter_parameters,
)
