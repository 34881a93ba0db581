"""One acceleration axis has the wrong sign.

Law
---
reading = -(reading), bias and noise with it.

Limits
------
The whole recording.

Alike
-----
None where the axis carries a signal; on an axis that only sees noise it cannot be seen.
"""

import numpy as np

from escalator_twin.causes.base import Cause, Location, Theta
from escalator_twin.causes.imperfections import ACCELERATION, needed
from escalator_twin.causes.places import AXIS
from escalator_twin.causes.recordings import with_parts
from escalator_twin.machine import Machine
from escalator_twin.signals import Recording


def alter_recording(
    recording: Recording, machine: Machine, location: Location, _: Theta, _rng: np.random.Generator
) -> Recording:
    """Return ``recording`` with one axis of every accelerometer inverted."""
    channels = tuple(
        s.channel
        for s in machine.instruments.sensors
        if s.quantity == ACCELERATION and s.at.get('axis') == location['axis']
    )
    for channel in needed(channels, f'an accelerometer along {location["axis"]}'):
        if channel in recording.signals:
            recording = with_parts(recording, channel, -recording.signals[channel].parts)
    return recording


CAUSE = Cause(
    name='axis_inverted',
    law='one acceleration axis has the wrong sign',
    parameters=(),
    places=(AXIS,),
    references=(),
    acts_on=('step_acceleration',),
    locked_to=('guide',),
    alter_recording=alter_recording,
)
