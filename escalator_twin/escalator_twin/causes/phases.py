"""Phases that nobody knows: a parameter of their own, 0 unless given."""

from math import pi

from escalator_twin.causes.base import Parameter

# at the recording's first sample, as far as a run starts where it was asked to
PHASE = Parameter('phase_rad', 'rad', -2.0 * pi, 2.0 * pi, default=0.0)

# By what share a roller turns more than its way over its radius: no tread's radius is known to the
# tenth of a millimetre that a loop of a hundred turns asks for.
SLIP = Parameter('slip', '-', -0.01, 0.01, default=0.0)
