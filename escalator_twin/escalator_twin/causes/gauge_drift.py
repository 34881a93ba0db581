r"""A link's gauges creep over the recording.

Law
---
All gauges of the link read too much by ``strain`` g(x), x the part of the recording that has
passed, 0 to 1:

.. math:: g(x) = (1 - e^{-c x}) / (1 - e^{-c})

from 0 at the first sample to ``strain`` at the last. c = ``curvature``: 0 is a straight line;
creep of an adhesive slows down, 2 unless given.

Limits
------
One smooth course without return; what thermal drift does within its tolerance is none.

Alike
-----
None: no machine cause changes the mean of one link over minutes.
"""

from dataclasses import replace

from escalator_twin.causes.base import Cause, Location, Parameter, Theta
from escalator_twin.causes.imperfections import Creep, Imperfections
from escalator_twin.causes.places import find_channel, GAUGED_LINK, text
from escalator_twin.machine import Machine

CURVATURE = 2.0  # half of the creep has come after 28 % of the recording


def alter_imperfections(
    imperfections: Imperfections, machine: Machine, location: Location, theta: Theta
) -> Imperfections:
    """Return ``imperfections`` with creep in all gauges of a link."""
    if theta['strain'] == 0.0:
        return imperfections
    channel = find_channel(machine, text(location, 'link'))
    sensor, errors = machine.instruments.sensor(channel), imperfections.sensors[channel]
    creep = Creep(theta['strain'] * sensor.sign * sensor.scale, theta['curvature'])
    return imperfections.with_sensor(channel, replace(errors, creep=(*errors.creep, creep)))


CAUSE = Cause(
    name='gauge_drift',
    law="creep of a link's gauges to this strain over the recording",
    parameters=(
        Parameter('strain', 'm/m', -1e-3, 1e-3, neutral=0.0, tolerance=1e-6),
        Parameter('curvature', '-', 0.0, 10.0, default=CURVATURE),
    ),
    places=(GAUGED_LINK,),
    references=({'strain': 1e-5},),
    acts_on=('link_force',),
    locked_to=('time',),
    alter_imperfections=alter_imperfections,
)
