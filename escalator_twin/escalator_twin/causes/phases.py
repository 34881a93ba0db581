"""Phases that nobody knows: a parameter of their own, 0 unless given."""

from math import pi

from escalator_twin.causes.base import Parameter

# at the recording's first sample, as far as a run starts where it was asked to
PHASE = Parameter('phase_rad', 'rad', -2.0 * pi, 2.0 * pi, default=0.0)
