"""Where a link or a roller is on a gear: there the twin's law of yielding treads decides alone.

How a link pulls where its rollers lie in seats depends on how treads yield, which no data sheet
tells: twin and machine may differ there by half the tension. Forces are compared elsewhere.
"""

import numpy as np

from escalator_twin.diagnosis.observation import Observation
from escalator_twin.machine import Machine, MultibodyMachine
from escalator_twin.physics.multibody.guide import chain_track, STEP_SEGMENTS
from escalator_twin.physics.multibody.segments import LENGTH, START
from escalator_twin.signals import Floats

GEARS = ('upper gear', 'lower gear')
MARGIN_M = 0.1  # beyond a gear's ends: the width of the 20 Hz low-pass, and some of the ramp
ENDS = {'link_force': (0, 1), 'roller_reaction': (0,)}  # axles that matter, from the own index on


def on_gear(machine: Machine, place_m: Floats) -> np.ndarray:
    """Tell for path coordinates whether a chain roller there is on a gear, or nearly."""
    assert isinstance(machine, MultibodyMachine)
    track = chain_track(machine)
    found = np.zeros(len(place_m), bool)
    for row, name in zip(track.rows, STEP_SEGMENTS, strict=True):
        if name in GEARS:
            way = (place_m - row[START] + MARGIN_M) % track.length_m
            found |= way < row[LENGTH] + 2.0 * MARGIN_M
    return found


def off_gears(observation: Observation, place_m: Floats, machine: Machine) -> np.ndarray:
    """Return the observation's valid samples without those that a gear decides, (n, c).

    Parameters
    ----------
    observation : Observation
    place_m : (n,) float64
        Path coordinate of axle 0.
    machine : Machine
    """
    valid = observation.valid.copy()
    for k, channel in enumerate(observation.channels):
        sensor = machine.instruments.sensor(channel)
        own = sensor.at.get('link', sensor.at.get('step', 0))
        assert isinstance(own, int)
        for ahead in ENDS.get(sensor.quantity, ()):
            valid[:, k] &= ~on_gear(machine, place_m + (own + ahead) * machine.chain.pitch_m)
    return valid
