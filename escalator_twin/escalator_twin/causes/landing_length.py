"""The upper landing is laid longer, or shorter, on both runs.

Law
---
The straight segments between upper transition and upper turnaround are longer by delta_m on both
runs; the turnaround moves out by as much, and the loop is longer by twice that. The carriage
comes in by delta_m, the polygon meets the upper curves delta_m / pitch of a period later, and the
places of survey, drive and load stay where they are on their rails: path coordinates remain those
of the design path, the longer landing being mapped evenly on the designed one.

Limits
------
Level and straight; both runs alike.

Alike
-----
``chain_elongation`` of both sides, which also takes up length.
"""

from escalator_twin.causes.base import Cause, Location, Parameter, Theta
from escalator_twin.causes.places import LANDING
from escalator_twin.machine import Machine
from escalator_twin.physics.parameters import Parameters
from escalator_twin.physics.path import build_path


def alter_parameters(
    parameters: Parameters, machine: Machine, _: Location, theta: Theta
) -> Parameters:
    """Return ``parameters`` with the upper landings longer."""
    if theta['delta_m'] == 0.0:
        return parameters
    path = build_path(machine.guide, theta['delta_m'])
    return parameters._replace(segments=path.segments)


CAUSE = Cause(
    name='landing_length',
    law='the upper landing laid longer (+) or shorter, both runs',
    parameters=(Parameter('delta_m', 'm', -0.1, 0.1, neutral=0.0, tolerance=1e-3),),
    places=(LANDING,),
    references=({'delta_m': 6e-3},),
    acts_on=('carriage_displacement', 'link_force', 'step_acceleration', 'roller_normal_force'),
    locked_to=('travel', 'guide'),
    alike=('chain_elongation',),
    alter_parameters=alter_parameters,
)
