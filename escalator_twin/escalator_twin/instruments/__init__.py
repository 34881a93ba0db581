"""The instruments: from the twin's exact signals to what loggers and recorder write down."""

from escalator_twin.instruments.recorder import ideal, record, recorded_sensors
from escalator_twin.instruments.tolerance import draw

__all__ = ['draw', 'ideal', 'record', 'recorded_sensors']
