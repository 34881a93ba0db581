r"""Rolling resistance falls with speed.

Law
---
The rolling resistance of every roller is multiplied by

.. math:: 1 + r \exp(-|v| / v_0)

r = ``rise``, v_0 = ``speed_m_s``, v the roller's own speed along the path.

Limits
------
At one speed of the machine it equals ``rolling_resistance`` with factor 1 + r exp(-v / v_0), up
to the ripple of v: then either is right, as the other's alternative. Two speeds tell them apart.

Alike
-----
``rolling_resistance``.
"""

from escalator_twin.causes.base import Cause, Location, Parameter, Theta
from escalator_twin.causes.bodies import with_column
from escalator_twin.machine import Machine, MultibodyMachine
from escalator_twin.physics.multibody import network as net
from escalator_twin.physics.multibody.layout import Layout
from escalator_twin.physics.parameters import Parameters


def alter_parameters(
    parameters: Parameters, _machine: Machine, _: Location, theta: Theta
) -> Parameters:
    """Return ``parameters`` with the law of speed."""
    if theta['rise'] == 0.0:
        return parameters
    return parameters._replace(friction_rise=theta['rise'], friction_speed=theta['speed_m_s'])


def alter_layout(layout: Layout, _machine: MultibodyMachine, _: Location, theta: Theta) -> Layout:
    """Return free bodies whose rollers' resistance falls with speed."""
    if theta['rise'] == 0.0:
        return layout
    layout = with_column(layout, 'drag', slice(None), net.D_RISE, theta['rise'], 0.0)
    return with_column(layout, 'drag', slice(None), net.D_FADE, theta['speed_m_s'], 0.0)


CAUSE = Cause(
    name='friction_speed',
    law='rolling resistance times 1 + rise exp(-v / speed)',
    parameters=(
        Parameter('rise', '-', 0.0, 20.0, neutral=0.0, tolerance=0.1),
        Parameter('speed_m_s', 'm/s', 0.01, 10.0),
    ),
    places=(),
    references=({'rise': 1.2, 'speed_m_s': 0.2},),
    acts_on=('link_force', 'carriage_displacement', 'step_acceleration', 'roller_normal_force'),
    locked_to=('guide', 'load'),
    alike=('rolling_resistance',),
    alter_parameters=alter_parameters,
    alter_layout=alter_layout,
)
