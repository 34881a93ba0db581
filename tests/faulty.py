"""Recordings with something wrong put into a channel, and what the check says of them."""

from makers import changed, prototype
import numpy as np

from escalator_twin.check import quality

MACHINE = prototype()
LEFT_A = 'link_force/left_a'
TENSIONER = 'tensioner/displacement'
Z = 'step/acceleration/z'
EA = 7.56e7


def found(recording, machine=MACHINE):
    return {(f.kind, f.channel) for f in quality(recording, machine)}


def only(recording, kind, channel=LEFT_A):
    findings = quality(recording, MACHINE)
    assert {(f.kind, f.channel) for f in findings} == {(kind, channel)}
    return findings


def with_parts(recording, channel, change):
    parts = np.array(recording.signals[channel].parts)
    change(parts)
    return changed(recording, channel, parts=parts)
