"""Isolated outliers in one channel.

Law
---
``count`` samples, drawn without return and not next to each other, are off by ``HEIGHT`` standard
deviations of the channel, either sign, in all fields alike.

Limits
------
Where they fall is drawn; their height is a choice of this model.

Alike
-----
None: no mechanical effect lasts one sample.
"""

import numpy as np

from escalator_twin.causes.base import Cause, Location, Parameter, Theta
from escalator_twin.causes.places import CHANNEL, find_channel, text
from escalator_twin.causes.recordings import with_parts
from escalator_twin.machine import Machine
from escalator_twin.signals import Recording

HEIGHT = 8.0  # standard deviations of the channel, well outside of what it does by itself


def alter_recording(
    recording: Recording,
    machine: Machine,
    location: Location,
    theta: Theta,
    rng: np.random.Generator,
) -> Recording:
    """Return ``recording`` with outliers in one channel."""
    channel, count = find_channel(machine, text(location, 'channel')), round(theta['count'])
    signal = recording.signals.get(channel)
    if signal is None or count == 0:
        return recording
    places = 2 * rng.permutation(len(signal.values) // 2)[:count]
    height = HEIGHT * float(signal.values.std()) * rng.choice([-1.0, 1.0], len(places))
    parts = signal.parts.copy()
    parts[places] += height[:, None]
    return with_parts(recording, channel, parts)


CAUSE = Cause(
    name='sensor_spikes',
    law='isolated outliers',
    parameters=(Parameter('count', '-', 0.0, 1e6, neutral=0.0),),
    places=(CHANNEL,),
    references=({'count': 20.0},),
    acts_on=('link_force', 'step_acceleration', 'carriage_displacement'),
    locked_to=('sample',),
    alter_recording=alter_recording,
)
