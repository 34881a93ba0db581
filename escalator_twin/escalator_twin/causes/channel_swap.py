"""Two links' channels are exchanged: plugs in the wrong sockets.

Law
---
Each of the two channels holds what the other's instrument measured, zeros and gains with it.

Limits
------
Both channels of one kind; left and right of one link differ little in a symmetric machine, and
then their exchange is seen less than that of the two places of a side.

Alike
-----
None: two channels of the loop come back half a loop out of place at once.
"""

import numpy as np

from escalator_twin.causes.base import Cause, Location, Theta
from escalator_twin.causes.places import find_channel, items, TWO_CHANNELS
from escalator_twin.causes.recordings import with_parts
from escalator_twin.errors import MachineError
from escalator_twin.machine import Machine
from escalator_twin.signals import Recording


def alter_recording(
    recording: Recording, machine: Machine, location: Location, _: Theta, _rng: np.random.Generator
) -> Recording:
    """Return ``recording`` with two channels exchanged."""
    names = tuple(map(str, items(location, 'channels')))
    channels = [find_channel(machine, name) for name in names]
    sensors = [machine.instruments.sensor(channel) for channel in channels]
    if len(channels) != 2 or sensors[0].quantity != sensors[1].quantity:
        raise MachineError(f'location.channels: expected two of one quantity, found {names}')
    first, second = channels
    if not {first, second} <= set(recording.signals):
        return recording
    was = recording.signals
    recording = with_parts(recording, first, was[second].parts)
    return with_parts(recording, second, was[first].parts)


CAUSE = Cause(
    name='channel_swap',
    law="two links' channels are exchanged",
    parameters=(),
    places=(TWO_CHANNELS,),
    references=(),
    acts_on=('link_force',),
    locked_to=('link', 'guide'),
    alter_recording=alter_recording,
)
