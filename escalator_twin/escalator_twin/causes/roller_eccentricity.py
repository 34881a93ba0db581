r"""One roller's tread is eccentric.

Law
---
The tread's radius at the contact exceeds the nominal one by

.. math:: e(x) = a \sin(x / R + \varphi)

x the way rolled since the start, R the nominal radius, so that the roller's centre runs e nearer
to the middle of the channel on either track: once per 2 pi R = 0.2356 m (prototype), 1.72
cycles per pitch. ``phase_rad`` is at the recording's first sample.

Limits
------
Rolls without slipping, in the same sense on both tracks; e is small against R. In a planar model
one side's roller counts by half.

Alike
-----
``roller_flat`` of the same roller below its second harmonic.
"""

from escalator_twin.causes.base import Cause, Location, Parameter, Theta
from escalator_twin.causes.phases import PHASE, SLIP
from escalator_twin.causes.places import AXLE, integer, SIDE, text
from escalator_twin.causes.sides import add_phasor, with_slip
from escalator_twin.machine import Machine
from escalator_twin.physics.parameters import Parameters


def alter_parameters(
    parameters: Parameters, _machine: Machine, location: Location, theta: Theta
) -> Parameters:
    """Return ``parameters`` with one roller eccentric."""
    waves = add_phasor(
        parameters.eccentricity,
        text(location, 'side'),
        integer(location, 'axle'),
        theta['amplitude_m'],
        theta['phase_rad'],
    )
    slip = with_slip(
        parameters.tread_slip, text(location, 'side'), integer(location, 'axle'), theta['slip']
    )
    return parameters._replace(eccentricity=waves, tread_slip=slip)


CAUSE = Cause(
    name='roller_eccentricity',
    law='tread radius varies by plus and minus the amplitude once per turn',
    parameters=(
        Parameter('amplitude_m', 'm', 0.0, 0.005, neutral=0.0, tolerance=2e-5),
        PHASE,
        SLIP,
    ),
    places=(AXLE, SIDE),
    references=({'amplitude_m': 4e-4},),
    acts_on=('step_acceleration', 'link_force', 'roller_normal_force', 'carriage_displacement'),
    locked_to=('link', 'side', 'travel'),
    alike=('roller_flat',),
    alter_parameters=alter_parameters,
)
