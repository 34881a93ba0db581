"""Causes against recordings that others made and labelled: the label explains the residual."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt
import trials
import yaml

from escalator_twin import bagfile
from escalator_twin.causes import apply
from escalator_twin.comparison.judge import Aligned, judge
from escalator_twin.comparison.locate import locate, RATE_HZ, Setting
from escalator_twin.instruments import ideal
from escalator_twin.machine import Deviation, Machine
from escalator_twin.signals import Floats, Recording
from escalator_twin.twin import make_simulation, run_twin

pytestmark = [pytest.mark.issue(3), pytest.mark.shared, pytest.mark.slow]

SECONDS = 50.0  # about a loop
EDGE_S = 1.0  # of the filters


class Look(NamedTuple):
    """Where a label acts most: channel and band, Hz."""

    channel: str
    band_hz: tuple[float, float]


LOOKS = {
    'tensioner_friction': Look('link_force/left_a', (0.0, 20.0)),
    'roller_drag': Look('link_force/left_b', (0.0, 2.0)),
    'rolling_resistance': Look('link_force/left_a', (0.0, 2.0)),
    'drive_ripple': Look('tensioner/displacement', (0.0, 2.0)),
    'load_distribution': Look('link_force/left_a', (0.0, 2.0)),
    'gauge_gain': Look('link_force/left_b', (0.0, 2.0)),
    'roller_eccentricity': Look('link_force/left_a', (1.0, 5.0)),
}
UNKNOWN_PHASE = ('drive_ripple', 'roller_eccentricity')


def beginning(recording: Recording) -> Recording:
    """Return the first seconds of a recording."""
    end = min(int(s.bag_ns[0]) for s in recording.signals.values()) + round(SECONDS * 1e9)
    signals = {}
    for channel, s in recording.signals.items():
        kept = s.bag_ns < end
        signals[channel] = replace(
            s, stamp_ns=s.stamp_ns[kept], bag_ns=s.bag_ns[kept], values=s.values[kept],
            parts=s.parts[kept],
        )  # fmt: skip
    return replace(recording, signals=signals)


def aligned(setting: Setting, machine: Machine) -> Mapping[str, Aligned]:
    """Run a machine beside a recording, through ideal instruments with its deviations."""
    sensors = machine.instruments.sensors
    simulation = make_simulation(machine, setting.experiment)
    trace = run_twin(simulation, sensors, setting.start_s_m, setting.duration_s, RATE_HZ)
    read = ideal(trace, machine).signals
    columns = trace.columns.copy()
    for i, sensor in enumerate(sensors):
        if sensor.rate_hz == RATE_HZ:
            columns[:, i] = read[sensor.channel].values
    return judge(setting, replace(trace, columns=columns), machine).channels


def residual(channels: Mapping[str, Aligned], look: Look) -> float:
    """Return the root mean square of measured less simulated in a band."""
    one = channels[look.channel]
    low, high = look.band_hz
    difference = (one.measured - one.simulated)[one.valid]
    sections = butter(
        4, [low, high] if low else high, 'band' if low else 'low', fs=one.rate_hz, output='sos'
    )
    filtered = sosfiltfilt(sections, difference - difference.mean())
    edge = round(EDGE_S * one.rate_hz)
    return float(filtered[edge:-edge].std())


def find_phase(
    label: Deviation, setting: Setting, nominal: Mapping[str, Aligned], look: Look
) -> float:
    """Return the phase that explains most, from two runs a quarter turn apart."""
    machine = trials.prototype()
    plain = nominal[look.channel]
    waves: list[Floats] = []
    for phase in (0.0, np.pi / 2):
        item = replace(label, parameters={**label.parameters, 'phase_rad': phase})
        moved = aligned(setting, apply(machine, (item,)))[look.channel]
        waves.append(moved.simulated - plain.simulated)
    wanted = plain.measured - plain.simulated
    columns = np.column_stack([*waves, np.ones(len(wanted))])
    cosine, sine, _ = np.linalg.lstsq(columns, wanted, rcond=None)[0]
    return float(np.arctan2(sine, cosine))


def read_labels(shared: Path, name: str) -> tuple[Deviation, ...]:
    labels = yaml.safe_load((shared / 'measured/seeded/labels.yaml').read_text(encoding='utf-8'))
    return tuple(
        Deviation(x['cause'], dict(x['parameters']), dict(x.get('location', {})))
        for x in labels[name]
    )


@pytest.mark.parametrize('name', LOOKS)
def test_a_label_explains_at_least_half_of_the_residual(name, shared):
    machine, look = trials.prototype(), LOOKS[name]
    recording = beginning(bagfile.read(shared / 'measured/seeded' / name, machine))
    setting = locate(recording, machine)
    before = aligned(setting, machine)
    (label,) = read_labels(shared, name)
    if name in UNKNOWN_PHASE:
        phase = find_phase(label, setting, before, look)
        label = replace(label, parameters={**label.parameters, 'phase_rad': phase})
    after = aligned(setting, apply(machine, (label,)))
    assert residual(after, look) <= 0.5 * residual(before, look)
    # the other channels of the same kind are not made worse
    for channel in before:
        if channel.split('/')[0] == look.channel.split('/')[0]:
            other = look._replace(channel=channel)
            assert residual(after, other) <= 1.05 * residual(before, other)
