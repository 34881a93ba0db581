"""The carriage meets a hard stop on its way out.

Law
---
Beyond the displacement u_s a stiff spring with a damper pushes back and never pulls:

    F = -max(STIFFNESS (u - u_s) + DAMPING u', 0)        u > u_s

``displacement_m`` is u_s, outward positive, from the model's rest position: the place of the
carriage at which the data sheet's path lengths and preload hold (u = 0). It is not the place at
which a loaded machine stands still, since that moves with the polygon effect by the whole stroke
of the carriage.

Limits
------
One stop, 700 times stiffer than the spring of the tensioner; how stiff a real one is nobody
says, and half or five times this stiffness changes the forces by a tenth of the effect. Where the
stop lies outside the motion it does nothing: the neutral value is infinity.

Alike
-----
``tensioner_friction`` where the stop is met for a short part of the motion only.
"""

from math import inf

from escalator_twin.causes.base import Cause, Location, Parameter, Theta
from escalator_twin.machine import Machine
from escalator_twin.physics.parameters import Parameters
from escalator_twin.signals import Floats

STIFFNESS_N_M = 2.0e7  # N/m, a welded bracket: yields 0.1 mm under 2 kN
DAMPING_N_S_M = 2.0e4  # N s/m, a fifth of critical with a carriage of 120 kg
UPPER_SHARE = 0.75  # of the range of motion: the middle of its upper half


def alter_parameters(
    parameters: Parameters, _machine: Machine, _: Location, theta: Theta
) -> Parameters:
    """Return ``parameters`` with a stop, the nearer one where there are two."""
    stop = min(parameters.carriage_stop, theta['displacement_m'])
    if stop == inf:
        return parameters
    return parameters._replace(
        carriage_stop=stop, stop_stiffness=STIFFNESS_N_M, stop_damping=DAMPING_N_S_M
    )


def reference_size(displacement_m: Floats) -> float:
    """Return the reference stop for a carriage that moves like this without one, m."""
    low, high = float(displacement_m.min()), float(displacement_m.max())
    return low + UPPER_SHARE * (high - low)


CAUSE = Cause(
    name='tensioner_stop',
    law='a hard stop met at this outward displacement',
    parameters=(Parameter('displacement_m', 'm', -0.1, inf, neutral=inf),),
    places=(),
    # the middle of the upper half of the motion of the prototype at 0.5 m/s up, empty, 3 kN
    references=({'displacement_m': 0.0048},),
    acts_on=('carriage_displacement', 'link_force', 'step_acceleration', 'roller_normal_force'),
    locked_to=('travel',),
    alike=('tensioner_friction',),
    alter_parameters=alter_parameters,
)
