"""Whether a channel reads in the unit that the machine's description says."""

from math import log

from escalator_twin.errors import RecordingError
from escalator_twin.machine import Sensor

# How much more a channel reads in another unit than in SI. Of strain and length a part in a thousand or a million, of
# acceleration gravity, of force a thousand or gravity.
FACTORS = {
    'link_force': {'1e-6': 1e6, '1e-3': 1e3, 'kN': 1e-3, 'kgf': 1.0 / 9.80665},
    'carriage_displacement': {'mm': 1e3, 'um': 1e6, 'cm': 1e2},
    'step_acceleration': {'g': 1.0 / 9.80665, 'mg': 1e3 / 9.80665, 'mm/s2': 1e3},
}
LEAST_R2 = 0.8  # what agrees less tells no slope
# Of a factor. An argument: a carriage's stroke follows its spring, and two of it are told as a cause; no cause makes five.
NEAR = 1.6


def require_unit(sensor: Sensor, squared: float, slope: float) -> None:
    """Refuse a channel that reads in another unit than is described.

    Parameters
    ----------
    sensor : Sensor
    squared : float
        Signed squared correlation with the twin's channel.
    slope : float
        Of the channel over the twin's.

    Raises
    ------
    RecordingError
    """
    if abs(squared) < LEAST_R2 or slope == 0.0:
        return
    for unit, factor in FACTORS.get(sensor.quantity, {}).items():
        if abs(log(abs(slope) / factor)) < log(NEAR):
            raise RecordingError(
                f'{sensor.channel}: reads {abs(slope):.3g} times what the twin does: expected {sensor.unit}, by the '
                f"machine's description, found as in {unit}; mend its instruments section (scale) or the recording"
            )
