"""Lay a fault of the measurement on a recording that was made elsewhere.

What an instrument does wrong, it does to whatever it measures: a recording of any machine, also of
another maker's, becomes one of that machine with a faulty instrument. Gains and creep act on what
was recorded, zeros, noise and resolution included.
"""

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from rig.bagfile import Recording, Series
from rig.faults import AXES, FAULTS
from rig.instruments import LINKS
from rig.make import Effect
from rig.recording import kept, Signals

STRAIN = '/measured/link/{}/strain'
IMU_TOPIC = '/measured/step/acceleration'
REFLEX = '/measured/tensioner/displacement'


def signals_of(series: dict[str, Series]) -> Signals:
    """Return the samples as the faults see them, times by each logger's own clock."""

    def since_start(one: Series) -> np.ndarray:
        return (one.stamp_ns - one.stamp_ns[0]) * 1e-9

    return Signals(
        onboard_s=since_start(series[IMU_TOPIC]),
        ground_s=since_start(series[REFLEX]),
        strain=np.stack([series[STRAIN.format(link)].values for link in LINKS]),
        acceleration=series[IMU_TOPIC].values,
        displacement=series[REFLEX].values[:, 0],
        keep={},
    )


def by_kit(signals: Signals, effect: Effect) -> Signals:
    """Return the samples as a wrong gain or pose makes them."""
    if effect.cause == 'gauge_gain':
        strain = signals.strain.copy()
        strain[LINKS.index(effect.location['link'])] *= effect.parameters['factor']
        return replace(signals, strain=strain)
    if effect.cause == 'accelerometer_misalignment':
        angles = [effect.parameters[f'{axis}_deg'] for axis in AXES]
        turn = Rotation.from_rotvec(angles, degrees=True).inv()
        return replace(signals, acceleration=turn.apply(signals.acceleration))
    return signals


def run_off(one: Series, ppm: float) -> Series:
    """Return a topic stamped by a clock that runs faster by ``ppm``."""
    since = one.stamp_ns - one.stamp_ns[0]
    return replace(one, stamp_ns=one.stamp_ns + np.round(since * ppm * 1e-6).astype(np.int64))


def graft(recording: Recording, effect: Effect, rng: np.random.Generator) -> Recording:
    """Return the recording with one instrument at fault.

    Raises
    ------
    KeyError
        Where the effect is not one of the measurement, or a topic is missing.
    """
    series = {one.topic: one for one in recording.series}
    signals = by_kit(signals_of(series), effect)
    signals = FAULTS[effect.cause].signals(signals, effect.location, effect.parameters, rng)
    values = {STRAIN.format(link): signals.strain[k] for k, link in enumerate(LINKS)}
    values[IMU_TOPIC] = signals.acceleration
    values[REFLEX] = signals.displacement[:, None]
    channels = {STRAIN.format(link): f'link_force/{link}' for link in LINKS}
    channels |= {IMU_TOPIC: 'step/acceleration', REFLEX: 'tensioner/displacement'}
    done = []
    for one in recording.series:
        changed = one
        if one.topic in values:
            mask = signals.keep.get(channels[one.topic])
            changed = kept(replace(one, values=values[one.topic]), mask)
        if effect.cause == 'clock_drift' and (one.topic != REFLEX):
            changed = run_off(changed, effect.parameters['ppm'])
        done.append(changed)
    return replace(recording, series=tuple(done))
