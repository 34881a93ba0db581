"""What is in a recording and what is wrong with it, as far as that shows without a model."""

from escalator_twin.check.clock import ClockComparison, compare_clocks
from escalator_twin.check.document import check
from escalator_twin.check.quality import quality

__all__ = ['ClockComparison', 'check', 'compare_clocks', 'quality']
