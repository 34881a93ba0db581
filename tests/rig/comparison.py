"""Figures of a recording beside what the rig says of it, per channel and band."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rig.instruments import (
    ACCELERATION_NOISE,
    GROUND_HZ,
    LINKS,
    ONBOARD_HZ,
    REFLEX_NOISE,
    STRAIN_NOISE,
)
from rig.measured import Measured
from rig.sheet import Sheet
from rig.travel import EDGE_S, low_pass

FloatArray = NDArray[np.float64]
Channels = dict[str, FloatArray]

FORCES = tuple(f'link_force/{link}' for link in LINKS)
TENSIONER = 'tensioner/displacement'
ACCELERATIONS = tuple(f'step/acceleration/{axis}' for axis in 'xyz')
CHANNELS = (*FORCES, TENSIONER, *ACCELERATIONS)
BANDS_HZ = (2.0, 20.0)
FORCE_NOISE_N = Sheet().section_stiffness_n * STRAIN_NOISE / 2.0  # N, of four gauges' mean
NOISE = {
    **dict.fromkeys(FORCES, FORCE_NOISE_N),
    TENSIONER: REFLEX_NOISE,
    **dict.fromkeys(ACCELERATIONS, ACCELERATION_NOISE),
}


@dataclass(frozen=True)
class Figure:
    """One channel in one band: correlation, rms of residual, signal and noise."""

    r: float
    residual: float
    signal: float
    noise: float


def rate_of(channel: str) -> float:
    """Return the channel's sampling rate (Hz)."""
    return GROUND_HZ if channel == TENSIONER else ONBOARD_HZ


def inside(channel: str) -> slice:
    """Return the samples away from the filter's ends."""
    edge = int(EDGE_S * rate_of(channel))
    return slice(edge, -edge)


def channels_of(measured: Measured) -> Channels:
    """Return the measured channels by name."""
    result = {channel: measured.force[k] for k, channel in enumerate(FORCES)}
    result[TENSIONER] = measured.displacement
    result.update({channel: measured.acceleration[k] for k, channel in enumerate(ACCELERATIONS)})
    return result


def in_band(channels: Channels, cut_hz: float) -> Channels:
    """Return the channels low-passed and without the filter's ends."""
    return {
        name: low_pass(values, rate_of(name), cut_hz)[inside(name)]
        for name, values in channels.items()
    }


def turned(measured: Channels, said: Channels) -> Channels:
    """Turn the said acceleration by the small rotation, and add the bias, that fit best."""
    m = np.stack([measured[name] for name in ACCELERATIONS])
    x, y, z = (said[name] for name in ACCELERATIONS)
    none = np.zeros_like(x)
    one = np.ones_like(x)
    # measured - said = said x rotation + bias, for a sensor turned by a small vector
    design = np.concatenate(
        [
            np.stack([none, -z, y, one, none, none], axis=1),
            np.stack([z, none, -x, none, one, none], axis=1),
            np.stack([-y, x, none, none, none, one], axis=1),
        ]
    )
    left = (m - np.stack([x, y, z])).ravel()
    found = np.linalg.lstsq(design, left, rcond=None)[0]
    better = np.stack([x, y, z]) + (design @ found).reshape(3, -1)
    return {**said, **dict(zip(ACCELERATIONS, better, strict=True))}


def compare(measured: Channels, said: Channels) -> dict[float, dict[str, Figure]]:
    """Return the figures per band and channel, means removed."""
    result = {}
    for cut_hz in BANDS_HZ:
        m = in_band(measured, cut_hz)
        p = turned(m, in_band(said, cut_hz))
        result[cut_hz] = {
            name: Figure(
                float(np.corrcoef(m[name], p[name])[0, 1]),
                float((m[name] - p[name]).std()),
                float(m[name].std()),
                float(NOISE[name] * np.sqrt(2.0 * cut_hz / rate_of(name))),
            )
            for name in CHANNELS
        }
    return result


def acts_most(without: Channels, with_label: Channels) -> tuple[float, str]:
    """Return band and channel where a label changes most, in units of the sensor's noise."""
    most = (0.0, BANDS_HZ[0], CHANNELS[0])
    for cut_hz in BANDS_HZ:
        a, b = in_band(without, cut_hz), in_band(with_label, cut_hz)
        for name in CHANNELS:
            noise = NOISE[name] * np.sqrt(2.0 * cut_hz / rate_of(name))
            most = max(most, (float((b[name] - a[name]).std() / noise), cut_hz, name))
    return most[1], most[2]
