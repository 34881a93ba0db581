r"""One roller has a flat spot.

Law
---
Once per turn, while the angle from the flat's middle is within 10 deg either way, the radius at
the contact falls short of the nominal one by

.. math:: d(\psi) = \tfrac{1}{2} d \, (1 + \cos(\pi \psi / 10^\circ))

``phase_rad`` is the turn left from the flat's middle at the recording's first sample: 0 is on
the rail.

Limits
------
Smooth, no impact of edges; ``slip`` is the share by which the roller turns more than its way over
its nominal radius. A second flat on the same roller replaces the
first. In a planar model one side's roller counts by half.

Alike
-----
``roller_eccentricity`` of the same roller where only the first order is seen.
"""

from escalator_twin.causes.base import Cause, Location, Parameter, Theta
from escalator_twin.causes.phases import PHASE, SLIP
from escalator_twin.causes.places import AXLE, integer, SIDE, text
from escalator_twin.causes.sides import rows_of, with_slip
from escalator_twin.machine import Machine
from escalator_twin.physics.parameters import Parameters, SIDES


def alter_parameters(
    parameters: Parameters, _machine: Machine, location: Location, theta: Theta
) -> Parameters:
    """Return ``parameters`` with one roller flattened."""
    if theta['depth_m'] == 0.0:
        return parameters
    flat = parameters.flat.copy()
    rows = rows_of(text(location, 'side'), len(flat))
    for row in rows:
        share = rows.count(row) * len(flat) / len(SIDES)
        flat[row, integer(location, 'axle')] = share * theta['depth_m'], theta['phase_rad']
    slip = with_slip(
        parameters.tread_slip, text(location, 'side'), integer(location, 'axle'), theta['slip']
    )
    return parameters._replace(flat=flat, tread_slip=slip)


CAUSE = Cause(
    name='roller_flat',
    law='a flat spot about 20 deg wide, once per turn',
    parameters=(
        Parameter('depth_m', 'm', 0.0, 0.01, neutral=0.0, tolerance=2e-5),
        PHASE,
        SLIP,
    ),
    places=(AXLE, SIDE),
    references=({'depth_m': 6e-4},),
    acts_on=('step_acceleration', 'link_force', 'roller_normal_force', 'carriage_displacement'),
    locked_to=('link', 'side', 'travel'),
    alike=('roller_eccentricity',),
    alter_parameters=alter_parameters,
)
