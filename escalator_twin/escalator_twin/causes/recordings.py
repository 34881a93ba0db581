"""Change one channel of a recording; everything else is shared with the original."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from escalator_twin.signals import Floats, make_signal, Recording


def with_parts(recording: Recording, channel: str, parts: Floats) -> Recording:
    """Return ``recording`` with other values (n, k) in one channel."""
    old = recording.signals[channel]
    new = make_signal(channel, old.unit, old.stamp_ns, old.bag_ns, parts)
    return replace(recording, signals={**recording.signals, channel: new})


def without(recording: Recording, channel: str, missing: NDArray[np.bool_]) -> Recording:
    """Return ``recording`` without the samples of one channel that are ``missing``."""
    if not missing.any():
        return recording
    old, kept = recording.signals[channel], ~missing
    new = make_signal(channel, old.unit, old.stamp_ns[kept], old.bag_ns[kept], old.parts[kept])
    return replace(recording, signals={**recording.signals, channel: new})
