"""A link's gauges all read too high, or too low: a wrong calibration.

Law
---
reading = factor * (1 + gain error of the gauge) * strain + zero.

Limits
------
Linear. The zero and the thermal drift do not scale with it.

Alike
-----
``load_offset`` in part, in a loaded machine with one instrumented link a side.
"""

from dataclasses import replace

from escalator_twin.causes.base import Cause, Location, Parameter, Theta
from escalator_twin.causes.imperfections import Imperfections
from escalator_twin.causes.places import find_channel, GAUGED_LINK, text
from escalator_twin.machine import Machine


def alter_imperfections(
    imperfections: Imperfections, machine: Machine, location: Location, theta: Theta
) -> Imperfections:
    """Return ``imperfections`` with the gains of one link scaled."""
    channel = find_channel(machine, text(location, 'link'))
    errors = imperfections.sensors[channel]
    return imperfections.with_sensor(channel, replace(errors, gain=errors.gain * theta['factor']))


CAUSE = Cause(
    name='gauge_gain',
    law='all gauges of a link read factor times as much',
    parameters=(Parameter('factor', '-', 0.1, 10.0, neutral=1.0, tolerance=0.003),),
    places=(GAUGED_LINK,),
    references=({'factor': 1.09}, {'factor': 0.91}),
    acts_on=('link_force',),
    locked_to=('guide',),
    alike=('load_offset',),
    alter_imperfections=alter_imperfections,
)
