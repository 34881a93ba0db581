"""The causes of the measurement: instruments that lie, each in its own way."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from rig.instruments import Instruments, LINKS
from rig.recording import Signals

Place = dict[str, Any]
Size = dict[str, float]
Change = Callable[[np.ndarray], np.ndarray]

CREEP_SHARE = 0.3  # -, time constant of a gauge's creep over the recording's length
SPIKE_STRAIN = (30e-6, 200e-6)  # m/m, smallest and largest outlier of a gauge
SPIKE_ACCELERATION = (3.0, 20.0)  # m/s2
SPIKE_DISPLACEMENT = (1e-3, 5e-3)  # m
AXES = ('x', 'y', 'z')


# Links' plugs are in the wrong sockets: after what is wrong at the gauges, before what channels lose.
AFTER_THE_PLUGS = ('data_gap', 'sensor_spikes')


def place_in_chain(cause: str) -> int:
    """Return where a fault sits between gauge and recorder, by which faults of one recording are laid."""
    return 1 if cause == 'channel_swap' else 2 if cause in AFTER_THE_PLUGS else 0


def same_kit(kit: Instruments, _place: Place, _size: Size) -> Instruments:
    """Leave the instruments as they are."""
    return kit


def same_signals(
    signals: Signals, _place: Place, _size: Size, _rng: np.random.Generator
) -> Signals:
    """Leave the samples as they are."""
    return signals


@dataclass(frozen=True)
class Fault:
    """What a fault changes: the instruments, or the samples that they gave."""

    kit: Callable[[Instruments, Place, Size], Instruments] = same_kit
    signals: Callable[[Signals, Place, Size, np.random.Generator], Signals] = same_signals


def with_strain(signals: Signals, link: str, change: Change) -> Signals:
    """Change one link's samples, (n, 4 gauges) m/m."""
    strain = signals.strain.copy()
    strain[LINKS.index(link)] = change(strain[LINKS.index(link)])
    return replace(signals, strain=strain)


def with_axis(signals: Signals, axis: str, change: Change) -> Signals:
    """Change one axis' samples of the accelerometer, (n,) m/s2."""
    acceleration = signals.acceleration.copy()
    k = AXES.index(axis)
    acceleration[:, k] = change(acceleration[:, k])
    return replace(signals, acceleration=acceleration)


def gauge_gain(kit, place, size):
    gain = kit.gauge_gain.copy()
    gain[LINKS.index(place['link'])] *= size['factor']
    return replace(kit, gauge_gain=gain)


def accelerometer_misalignment(kit, _place, size):
    return replace(kit, rotation_deg=np.array([size[f'{axis}_deg'] for axis in AXES]))


def clock_drift(kit, _place, size):
    return replace(kit, clock_drift=size['ppm'] * 1e-6)


def gauge_drift(signals, place, size, _rng):
    part = signals.onboard_s / signals.onboard_s[-1]
    creep = (1.0 - np.exp(-part / CREEP_SHARE)) / (1.0 - np.exp(-1.0 / CREEP_SHARE))
    return with_strain(signals, place['link'], lambda one: one + size['strain'] * creep[:, None])


def gauge_dead(signals, place, _size, _rng):
    strain = signals.strain.copy()
    k, g = LINKS.index(place['link']), int(place['gauge']) - 1
    strain[k, :, g] = strain[k, 0, g]
    return replace(signals, strain=strain)


def axis_inverted(signals, place, _size, _rng):
    acceleration = signals.acceleration.copy()
    acceleration[:, AXES.index(place['axis'])] *= -1.0
    return replace(signals, acceleration=acceleration)


def channel_swap(signals, place, _size, _rng):
    one, other = (LINKS.index(name.split('/')[-1]) for name in place['channels'])
    strain = signals.strain.copy()
    strain[[one, other]] = strain[[other, one]]
    return replace(signals, strain=strain)


def mains_hum(signals, place, size, rng):
    phase = rng.uniform(0.0, 2.0 * np.pi)
    tone = size['strain'] * np.sin(2.0 * np.pi * size['frequency_hz'] * signals.onboard_s + phase)
    strain = signals.strain.copy()
    for link in place['links']:
        strain[LINKS.index(link)] += tone[:, None]
    return replace(signals, strain=strain)


def data_gap(signals, place, size, _rng):
    keep = dict(signals.keep)
    for channel in place['channels']:
        name = 'step/acceleration' if channel.startswith('step/acceleration') else channel
        time_s = signals.ground_s if name.startswith('tensioner') else signals.onboard_s
        lost = (time_s >= size['from_s']) & (time_s < size['to_s'])
        keep[name] = keep.get(name, np.ones(time_s.size, bool)) & ~lost
    return replace(signals, keep=keep)


def spikes(
    rng: np.random.Generator, size: int, count: int, span: tuple[float, float]
) -> np.ndarray:
    """Return isolated outliers of either sign at random samples."""
    result = np.zeros(size)
    where = rng.choice(size, count, replace=False)
    result[where] = rng.uniform(*span, count) * rng.choice([-1.0, 1.0], count)
    return result


def sensor_spikes(signals, place, size, rng):
    channel, count = place['channel'], int(size['count'])
    if channel.startswith('link_force/'):
        hit = spikes(rng, signals.onboard_s.size, count, SPIKE_STRAIN)
        return with_strain(signals, channel.split('/')[-1], lambda one: one + hit[:, None])
    if channel.startswith('step/acceleration'):
        hit = spikes(rng, signals.onboard_s.size, count, SPIKE_ACCELERATION)
        return with_axis(signals, channel.split('/')[-1], lambda one: one + hit)
    hit = spikes(rng, signals.displacement.size, count, SPIKE_DISPLACEMENT)
    return replace(signals, displacement=signals.displacement + hit)


FAULTS: dict[str, Fault] = {
    'gauge_gain': Fault(kit=gauge_gain),
    'gauge_drift': Fault(signals=gauge_drift),
    'gauge_dead': Fault(signals=gauge_dead),
    'accelerometer_misalignment': Fault(kit=accelerometer_misalignment),
    'axis_inverted': Fault(signals=axis_inverted),
    'channel_swap': Fault(signals=channel_swap),
    'clock_drift': Fault(kit=clock_drift),
    'mains_hum': Fault(signals=mains_hum),
    'data_gap': Fault(signals=data_gap),
    'sensor_spikes': Fault(signals=sensor_spikes),
}
