"""Faults of the measurement that are on no list; every name begins with ``unlisted_``."""

from dataclasses import replace

import numpy as np
from scipy.signal import bilinear, lfilter

from rig.faults import Fault, with_axis, with_strain
from rig.instruments import LINKS

BURST_S = 0.15  # s, of a radio's burst


def crosstalk(signals, place, size, _rng):
    """Let one link's gauges pick up a share of another's."""
    strain = signals.strain.copy()
    to, source = (LINKS.index(name) for name in place['links'])
    strain[to] += size['share'] * (signals.strain[source] - signals.strain[source].mean(axis=0))
    return replace(signals, strain=strain)


def sticking_reflex(signals, _place, size, _rng):
    """Let the reflex sensor's reading lag behind by a dead band."""
    seen = signals.displacement.copy()
    half = 0.5 * size['band_m']
    for i in range(1, seen.size):
        seen[i] = min(max(seen[i - 1], seen[i] - half), seen[i] + half)
    return replace(signals, displacement=seen)


def reflex_gain(signals, _place, size, _rng):
    """Let the reflex sensor tell every motion ``factor`` times as large."""
    middle = signals.displacement.mean()
    return replace(signals, displacement=middle + size['factor'] * (signals.displacement - middle))


def acceleration_gain(signals, place, size, _rng):
    """Let one axis of the accelerometer read too much."""
    return with_axis(signals, place['axis'], lambda one: one * size['factor'])


def late_bridge(signals, place, size, _rng):
    """Let one link's bridge amplifier be late by ``delay_s``, the stamps knowing nothing of it."""
    before = signals.onboard_s - size['delay_s']
    return with_strain(
        signals,
        place['link'],
        lambda one: np.stack(
            [np.interp(before, signals.onboard_s, gauge) for gauge in one.T], axis=1
        ),
    )


def slow_bridge(signals, place, size, _rng):
    """Let one link's bridge amplifier be a first-order low-pass of ``corner_hz``."""
    step_s = float(np.median(np.diff(signals.onboard_s)))
    share = 1.0 - np.exp(-2.0 * np.pi * size['corner_hz'] * step_s)

    def smoothed(one):
        result = one.copy()
        for i in range(1, len(one)):
            result[i] = result[i - 1] + share * (one[i] - result[i - 1])
        return result

    return with_strain(signals, place['link'], smoothed)


def jumping_zero(signals, place, size, _rng):
    """Let the zeros of one link's gauges jump at a share of the recording: a plug was touched."""
    after = signals.onboard_s >= size['at_share'] * signals.onboard_s[-1]
    return with_strain(signals, place['link'], lambda one: one + size['strain'] * after[:, None])


def warming_gauges(signals, place, size, _rng):
    """Let one link's gauges warm and cool again once within the recording."""
    turn = 2.0 * np.pi * signals.onboard_s / signals.onboard_s[-1]
    return with_strain(
        signals,
        place['link'],
        lambda one: one + 0.5 * size['strain'] * (1.0 - np.cos(turn))[:, None],
    )


def drifting_reflex(signals, _place, size, _rng):
    """Let the reflex sensor's zero drift evenly by ``drift_m`` over the recording."""
    part = signals.ground_s / signals.ground_s[-1]
    return replace(signals, displacement=signals.displacement + size['drift_m'] * part)


def drifting_accelerometer(signals, place, size, _rng):
    """Let one axis' zero drift evenly by ``drift_m_s2`` over the recording."""
    part = signals.onboard_s / signals.onboard_s[-1]
    return with_axis(signals, place['axis'], lambda one: one + size['drift_m_s2'] * part)


def noisy_bridge(signals, place, size, rng):
    """Let one link's bridge amplifier be noisy."""
    return with_strain(
        signals, place['link'], lambda one: one + size['strain'] * rng.standard_normal(one.shape)
    )


def coarse_bridge(signals, place, size, _rng):
    """Let one link's converter have lost its lowest bits."""
    step = size['strain']
    return with_strain(signals, place['link'], lambda one: step * np.round(one / step))


def bent_reflex(signals, _place, size, _rng):
    """Let the reflex sensor tell more the farther the carriage is out, ``per_m`` of it."""
    motion = signals.displacement - signals.displacement.mean()
    return replace(signals, displacement=signals.displacement + size['per_m'] * motion**2)


def slow_accelerometer(signals, _place, size, _rng):
    """Let the accelerometer's filter be a first-order low-pass of ``corner_hz``."""
    step_s = float(np.median(np.diff(signals.onboard_s)))
    share = 1.0 - np.exp(-2.0 * np.pi * size['corner_hz'] * step_s)
    seen = signals.acceleration.copy()
    for i in range(1, len(seen)):
        seen[i] = seen[i - 1] + share * (seen[i] - seen[i - 1])
    return replace(signals, acceleration=seen)


def humming_accelerometer(signals, place, size, _rng):
    """Let a loose cable sing on one axis of the accelerometer."""
    tone = np.sin(2.0 * np.pi * size['frequency_hz'] * signals.onboard_s)
    return with_axis(signals, place['axis'], lambda one: one + size['amplitude_m_s2'] * tone)


def clipped_bridge(signals, place, size, _rng):
    """Let one link's amplifier reach no further than a share of what it has to show."""

    def clipped(one):
        low, high = one.min(axis=0), one.max(axis=0)
        return np.minimum(one, low + size['share_of_range'] * (high - low))

    return with_strain(signals, place['link'], clipped)


def stepping_gain(signals, place, size, _rng):
    """Let one link's gain become another at a share of the recording."""
    after = signals.onboard_s >= size['at_share'] * signals.onboard_s[-1]
    gain = np.where(after, size['factor'], 1.0)[:, None]
    return with_strain(signals, place['link'], lambda one: one * gain)


def sticking_bridge(signals, place, size, _rng):
    """Let one link's gauges, whose bond creeps, lag behind by a dead band."""
    half = 0.5 * size['band_strain']

    def lagging(one):
        seen = one.copy()
        for i in range(1, len(seen)):
            seen[i] = np.clip(seen[i - 1], one[i] - half, one[i] + half)
        return seen

    return with_strain(signals, place['link'], lagging)


def bent_bridge(signals, place, size, _rng):
    """Let one link's line be bent: off by ``share`` of its range at both ends of it, one way."""

    def bent(one):
        low, high = one.min(axis=0), one.max(axis=0)
        middle, span = 0.5 * (low + high), high - low
        return one + 4.0 * size['share'] * (one - middle) ** 2 / span

    return with_strain(signals, place['link'], bent)


def bursts(signals, place, size, _rng):
    """Let one link's cable pick up bursts of a radio, ``every_s`` apart."""
    t = signals.onboard_s
    on = (t % size['every_s']) < BURST_S
    tone = size['strain'] * np.sin(2.0 * np.pi * size['frequency_hz'] * t) * on
    return with_strain(signals, place['link'], lambda one: one + tone[:, None])


def late_accelerometer(signals, _place, size, _rng):
    """Let the accelerometer's samples be late by ``delay_s``, the stamps knowing nothing of it."""
    before = signals.onboard_s - size['delay_s']
    late = [np.interp(before, signals.onboard_s, axis) for axis in signals.acceleration.T]
    return replace(signals, acceleration=np.stack(late, axis=1))


def ringing_accelerometer(signals, place, size, _rng):
    """Let the accelerometer stand on a loose mount that rings along one axis."""
    omega = 2.0 * np.pi * size['frequency_hz']
    mount = bilinear(
        [omega**2],
        [1.0, 2.0 * size['damping_ratio'] * omega, omega**2],
        1.0 / float(np.median(np.diff(signals.onboard_s))),
    )
    return with_axis(
        signals, place['axis'], lambda one: one.mean() + lfilter(*mount, one - one.mean())
    )


def clipped_accelerometer(signals, place, size, _rng):
    """Let one axis reach no further than a share of its largest motion, either way."""

    def clipped(one):
        middle = np.median(one)
        most = size['share_of_range'] * np.abs(one - middle).max()
        return np.clip(one, middle - most, middle + most)

    return with_axis(signals, place['axis'], clipped)


def held_reflex(signals, _place, size, _rng):
    """Let the reflex sensor look only every ``hold_s`` and tell the same in between."""
    every = max(round(size['hold_s'] / float(np.median(np.diff(signals.ground_s)))), 1)
    last = np.arange(signals.displacement.size) // every * every
    return replace(signals, displacement=signals.displacement[last])


UNLISTED_FAULTS: dict[str, Fault] = {
    'unlisted_crosstalk': Fault(signals=crosstalk),
    'unlisted_sticking_reflex': Fault(signals=sticking_reflex),
    'unlisted_reflex_gain': Fault(signals=reflex_gain),
    'unlisted_acceleration_gain': Fault(signals=acceleration_gain),
    'unlisted_late_bridge': Fault(signals=late_bridge),
    'unlisted_slow_bridge': Fault(signals=slow_bridge),
    'unlisted_jumping_zero': Fault(signals=jumping_zero),
    'unlisted_warming_gauges': Fault(signals=warming_gauges),
    'unlisted_drifting_reflex': Fault(signals=drifting_reflex),
    'unlisted_drifting_accelerometer': Fault(signals=drifting_accelerometer),
    'unlisted_noisy_bridge': Fault(signals=noisy_bridge),
    'unlisted_coarse_bridge': Fault(signals=coarse_bridge),
    'unlisted_bent_reflex': Fault(signals=bent_reflex),
    'unlisted_slow_accelerometer': Fault(signals=slow_accelerometer),
    'unlisted_humming_accelerometer': Fault(signals=humming_accelerometer),
    'unlisted_clipped_bridge': Fault(signals=clipped_bridge),
    'unlisted_stepping_gain': Fault(signals=stepping_gain),
    'unlisted_sticking_bridge': Fault(signals=sticking_bridge),
    'unlisted_bent_bridge': Fault(signals=bent_bridge),
    'unlisted_bursts': Fault(signals=bursts),
    'unlisted_late_accelerometer': Fault(signals=late_accelerometer),
    'unlisted_ringing_accelerometer': Fault(signals=ringing_accelerometer),
    'unlisted_clipped_accelerometer': Fault(signals=clipped_accelerometer),
    'unlisted_held_reflex': Fault(signals=held_reflex),
}
