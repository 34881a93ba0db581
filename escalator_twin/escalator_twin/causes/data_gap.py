"""Samples are missing.

Law
---
Messages whose logger time lies from ``from_s`` up to before ``to_s`` seconds after the first
sample of their channel are not in the recording. Channels that share a topic share the gap.

Limits
------
One gap; stamps before and after are right.

Alike
-----
None.
"""

import numpy as np

from escalator_twin.causes.base import Cause, Location, Parameter, Theta
from escalator_twin.causes.places import CHANNELS, find_channel, items
from escalator_twin.causes.recordings import without
from escalator_twin.machine import Machine
from escalator_twin.signals import Recording

LONGEST_S = 1e5  # s, more than a day


def alter_recording(
    recording: Recording,
    machine: Machine,
    location: Location,
    theta: Theta,
    _rng: np.random.Generator,
) -> Recording:
    """Return ``recording`` with a gap in some topics."""
    names = [str(name) for name in items(location, 'channels')]
    topics = {machine.instruments.sensor(find_channel(machine, name)).topic for name in names}
    for sensor in machine.instruments.sensors:
        signal = recording.signals.get(sensor.channel)
        if sensor.topic in topics and signal is not None and len(signal.stamp_ns):
            since = (signal.stamp_ns - signal.stamp_ns[0]) * 1e-9
            missing = (since >= theta['from_s']) & (since < theta['to_s'])
            recording = without(recording, sensor.channel, missing)
    return recording


CAUSE = Cause(
    name='data_gap',
    law='samples missing from one time to another',
    parameters=(
        Parameter('from_s', 's', 0.0, LONGEST_S),
        Parameter('to_s', 's', 0.0, LONGEST_S),
    ),
    places=(CHANNELS,),
    references=({'from_s': 3.0, 'to_s': 7.0},),
    acts_on=('link_force', 'step_acceleration', 'carriage_displacement'),
    locked_to=('sample',),
    alter_recording=alter_recording,
)
