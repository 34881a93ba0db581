"""Ride quality of the acceleration sensors of a comparison, measured beside simulated."""

from collections.abc import Mapping
from math import cos, radians, sin
from typing import Any, TYPE_CHECKING

import numpy as np

from escalator_twin.machine import Guide, Machine, Sensor
from escalator_twin.metrics.filters import Mask
from escalator_twin.metrics.ride_quality import AXES, ride_quality, weighted_noise
from escalator_twin.physics.course import course_of
from escalator_twin.signals import Floats

if TYPE_CHECKING:
    from escalator_twin.comparison.judge import Aligned

APPLIES = (
    'After ISO 18738-2: combined weighting (Wm of ISO 8041) on x, y and z of the tread, maximum '
    'of the running rms over 1 s, on the straight incline of the passenger run at steady speed. '
    'The sensor is rigid with the step and turned back by the inclination; gravity and bias go '
    'with the mean of each pass. Not covered: a person standing, the contact of tread and shoe, '
    'handrail, sound, start and stop. comfort_* are by ISO 2631-1 (Wk, Wd), peak_to_peak by the '
    'lift part. The measurement holds its sensor\'s noise, of which "noise" is the rms; the '
    'simulation has none.'
)


def ride_document(aligned: Mapping[str, 'Aligned'], machine: Machine) -> dict[str, Any] | None:
    """Return the ride quality of the first acceleration sensor; None where there is none.

    Parameters
    ----------
    aligned : mapping of channel to Aligned
        Bias and rotation already taken out of the measured accelerations.
    machine : Machine
    """
    sensors = {
        str(s.at['axis']): s
        for s in reversed(machine.instruments.sensors)
        if s.quantity == 'step_acceleration' and s.channel in aligned
    }
    if not sensors:
        return None
    there = {axis: aligned[s.channel] for axis, s in sensors.items()}
    first = next(iter(there.values()))
    n = min(len(one.valid) for one in there.values())
    measured, simulated = np.full((n, 3), np.nan), np.full((n, 3), np.nan)
    for i, axis in enumerate(AXES):
        if axis in there:
            one = there[axis]
            measured[:, i] = np.where(one.valid[:n], one.measured[:n], np.nan)
            simulated[:, i] = one.simulated[:n]
    step = next(iter(sensors.values())).at.get('step', 0)
    mask = on_incline(first.place_m[:n], machine, int(str(step)))
    incline = machine.guide.inclination_deg
    return {
        'measured': ride_quality(measured, first.rate_hz, mask, incline).document(),
        'simulated': ride_quality(simulated, first.rate_hz, mask, incline).document(),
        'noise': weighted_noise(_noise(sensors, incline), first.rate_hz),
        'applies': APPLIES,
    }


def on_incline(place_m: Floats, machine: Machine, step: int) -> Mask:
    """Tell where both axles of a step are on the straight part of the passenger run.

    Parameters
    ----------
    place_m : (n,) float64
        Path coordinate of axle 0.
    machine : Machine
    step : int
    """
    pitch, path = machine.chain.pitch_m, course_of(machine)
    lower, upper = straight_run(machine.guide, path.passenger_m)
    place = (place_m + step * pitch) % path.length_m
    return np.asarray((place >= lower) & (place + pitch <= upper))


def straight_run(guide: Guide, passenger_m: float) -> tuple[float, float]:
    """Return where the incline begins and ends; a level walk is all of it."""
    slope = radians(guide.inclination_deg)
    if slope == 0.0:
        return 0.0, passenger_m
    lower = guide.lower_landing_m + guide.lower_transition_radius_m * slope
    upper = guide.upper_landing_m + guide.upper_transition_radius_m * slope
    return lower, passenger_m - upper


def _noise(sensors: Mapping[str, Sensor], inclination_deg: float) -> dict[str, float]:
    """Return the noise of each axis of the tread, rounding included, m/s2."""
    own = {a: float(np.hypot(s.noise, s.resolution / 12.0**0.5)) for a, s in sensors.items()}
    c, s = cos(radians(inclination_deg)), sin(radians(inclination_deg))
    if {'x', 'z'} <= set(own):
        x, z = own['x'], own['z']
        own['x'], own['z'] = float(np.hypot(c * x, s * z)), float(np.hypot(s * x, c * z))
    return {axis: own[axis] for axis in AXES if axis in own}
