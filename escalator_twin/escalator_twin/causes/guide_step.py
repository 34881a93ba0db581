r"""A step in the guide at a rail joint: a smooth bump of the channel.

Law
---
The channel's centre line of the side(s) is raised along its normal, positive to the left of
travel in +s (up on the passenger run, down on the return run), by

.. math:: h(s) = \tfrac{1}{2} h \, (1 + \cos(2 \pi (s - s_0) / L)), \quad |s - s_0| < L / 2

``length_m`` is L, ``LENGTH_M`` unless given. Every roller of the side meets it: once a pitch of
travel in what all links share, and once a loop, strongly, where an instrumented link or step
passes.

Limits
------
4 to 8 cm long; the shape of a real joint is not known better. The bump is added to the survey's
table; a bump shorter than four cells of the table is not resolved.

Alike
-----
A survey error at the same place, below its tolerance.
"""

import numpy as np

from escalator_twin.causes.base import Cause, Location, Parameter, Theta
from escalator_twin.causes.places import number, S, SIDE_OR_BOTH, text
from escalator_twin.causes.sides import rows_of
from escalator_twin.machine import Machine
from escalator_twin.physics.parameters import Parameters, SIDES
from escalator_twin.physics.survey import STEP_M
from escalator_twin.signals import Floats

LENGTH_M = 0.06  # m, the middle of the 4 to 8 cm of contracts.md


def raised_cosine(s: Floats, centre: float, length: float, loop_m: float) -> Floats:
    """Return a bump of height 1 (m) and its slope round the loop: (n, 2)."""
    away = (s - centre + 0.5 * loop_m) % loop_m - 0.5 * loop_m
    inside = np.abs(away) < 0.5 * length
    angle = 2.0 * np.pi * away / length
    value = np.where(inside, 0.5 * (1.0 + np.cos(angle)), 0.0)
    slope = np.where(inside, -np.pi / length * np.sin(angle), 0.0)
    return np.column_stack([value, slope])


def fine_table(parameters: Parameters) -> Floats:
    """Return the survey's table; where there is no survey, zeros on its usual grid."""
    n = round(parameters.length_m / STEP_M)
    if parameters.survey.shape[1] >= n:
        return parameters.survey.copy()
    return np.zeros((len(parameters.survey), n, 2))


def alter_parameters(
    parameters: Parameters, _machine: Machine, location: Location, theta: Theta
) -> Parameters:
    """Return ``parameters`` with a bump in the survey's table of the side or sides."""
    if theta['height_m'] == 0.0:
        return parameters
    table, loop_m = fine_table(parameters), parameters.length_m
    s = np.arange(table.shape[1]) * (loop_m / table.shape[1])
    bump = raised_cosine(s, number(location, 's_m'), theta['length_m'], loop_m)
    for row in rows_of(text(location, 'side'), len(table)):
        table[row] += theta['height_m'] * len(table) / len(SIDES) * bump
    return parameters._replace(survey=table)


CAUSE = Cause(
    name='guide_step',
    law='a smooth bump of the channel, 4 to 8 cm long, at a rail joint',
    parameters=(
        Parameter('height_m', 'm', -0.02, 0.02, neutral=0.0, tolerance=1e-4),
        Parameter('length_m', 'm', 0.02, 0.3, default=LENGTH_M),
    ),
    places=(S, SIDE_OR_BOTH),
    references=({'height_m': 1.5e-3},),
    acts_on=('link_force', 'step_acceleration', 'carriage_displacement', 'roller_normal_force'),
    locked_to=('guide', 'side', 'travel'),
    alter_parameters=alter_parameters,
)
