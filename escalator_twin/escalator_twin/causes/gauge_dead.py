"""One gauge of a link is dead: it reads a constant.

Law
---
reading of gauge g = what it read first. The mean of the k gauges of the link, which is its
channel, then keeps (k - 1) / k of the force's variation and lets through bending / k with the
sign of the gauge's edge.

Limits
------
Dead throughout the recording. What value a dead gauge holds does not matter, since zeros are
unknown.

Alike
-----
``gauge_gain`` of factor (k - 1) / k, by the channel alone; the single gauges tell them apart.
"""

import numpy as np

from escalator_twin.causes.base import Cause, Location, Theta
from escalator_twin.causes.places import find_channel, GAUGE, GAUGED_LINK, integer, text
from escalator_twin.causes.recordings import with_parts
from escalator_twin.machine import Machine
from escalator_twin.signals import Recording


def alter_recording(
    recording: Recording, machine: Machine, location: Location, _: Theta, _rng: np.random.Generator
) -> Recording:
    """Return ``recording`` with one gauge constant."""
    channel = find_channel(machine, text(location, 'link'))
    signal = recording.signals.get(channel)
    if signal is None or not len(signal.values):
        return recording
    parts = signal.parts.copy()
    gauge = integer(location, 'gauge') - 1
    parts[:, gauge] = parts[0, gauge]
    return with_parts(recording, channel, parts)


CAUSE = Cause(
    name='gauge_dead',
    law='one gauge reads a constant',
    parameters=(),
    places=(GAUGED_LINK, GAUGE),
    references=(),
    acts_on=('link_force',),
    locked_to=('guide', 'travel'),
    alike=('gauge_gain',),
    alter_recording=alter_recording,
)
