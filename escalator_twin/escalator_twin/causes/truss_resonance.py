r"""The frame bounces vertically in one mode.

Law
---
The guide, the drive's rack and the tensioner's rails move together by w, upwards positive:

.. math:: m w'' + 2 \zeta \omega m w' + \omega^2 m w = F, \quad \omega = 2 \pi f

m = ``modal_mass_kg``, F the vertical reaction of all rollers and dogs. The step's accelerometer
sees w'' through the rollers.

Limits
------
One rigid shape, vertical only. The frame sags under the chain's weight W by W / (omega^2 m) from
its own rest; that moves everything alike and no instrument sees it. The neutral value of the
frequency is infinity: a rigid frame.

Alike
-----
None: a narrow band, locked to time.
"""

from math import inf, isinf, pi

import numpy as np

from escalator_twin.causes.base import Cause, Location, Parameter, Theta
from escalator_twin.machine import Machine
from escalator_twin.physics.parameters import Parameters


def alter_parameters(
    parameters: Parameters, _machine: Machine, _: Location, theta: Theta
) -> Parameters:
    """Return ``parameters`` with a frame on a spring; the last one given holds."""
    if isinf(theta['frequency_hz']):
        return parameters
    mass, omega = theta['modal_mass_kg'], 2.0 * pi * theta['frequency_hz']
    frame = np.array([mass, mass * omega**2, 2.0 * theta['damping_ratio'] * omega * mass])
    return parameters._replace(frame=frame)


CAUSE = Cause(
    name='truss_resonance',
    law='the frame bounces vertically in one mode',
    parameters=(
        Parameter('frequency_hz', 'Hz', 0.5, inf, neutral=inf),
        Parameter('damping_ratio', '-', 0.0, 2.0),
        Parameter('modal_mass_kg', 'kg', 10.0, 1e6),
    ),
    places=(),
    references=({'frequency_hz': 6.0, 'damping_ratio': 0.02, 'modal_mass_kg': 4500.0},),
    acts_on=('step_acceleration', 'link_force', 'roller_normal_force', 'carriage_displacement'),
    locked_to=('time', 'travel'),
    alter_parameters=alter_parameters,
)
