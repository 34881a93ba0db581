"""Causes of the measurement: each changes what it says, by how much it says, and nothing else."""

from dataclasses import replace

import numpy as np
import pytest
import trials

from escalator_twin.causes import apply, MEASUREMENT_CAUSES
from escalator_twin.instruments import ideal, record
from escalator_twin.machine import Deviation
from escalator_twin.signals import Recording

pytestmark = pytest.mark.issue(3)

EA = 7.56e7
FORCES = ('link_force/left_a', 'link_force/left_b', 'link_force/right_a', 'link_force/right_b')
AXES = tuple(f'step/acceleration/{axis}' for axis in 'xyz')


@pytest.fixture(scope='module')
def run():
    return trials.analytic(trials.prototype())


def recorded(run: object, *items: Deviation, seed: int | None = None) -> Recording:
    machine = apply(trials.prototype(), items)
    return ideal(run, machine) if seed is None else record(run, machine, seed=seed)


def touched(one: Recording, other: Recording) -> set[str]:
    """Return the channels in which two recordings differ at all."""
    return {
        channel
        for channel, signal in one.signals.items()
        for twin in (other.signals[channel],)
        if not (
            np.array_equal(signal.parts, twin.parts)
            and np.array_equal(signal.stamp_ns, twin.stamp_ns)
            and np.array_equal(signal.bag_ns, twin.bag_ns)
        )
    }


@pytest.mark.parametrize('name', [n for n, cause in MEASUREMENT_CAUSES.items() if cause.sizes])
def test_neutral_measurement_causes_change_nothing(name, run):
    cause = MEASUREMENT_CAUSES[name]
    neutral = Deviation(name, dict(cause.neutral()), trials.example(name))
    assert touched(recorded(run, neutral), recorded(run)) == set()


@pytest.mark.parametrize('name', MEASUREMENT_CAUSES)
def test_measurement_causes_leave_the_mechanics_alone(name):
    item = trials.deviation(name, trials.example(name))
    runs = [trials.trial(items, duration_s=0.05) for items in ((item,), ())]
    assert np.array_equal(runs[0].columns, runs[1].columns)


EXPECTED = {
    'gauge_gain': {FORCES[0]},
    'gauge_drift': {FORCES[0]},
    'gauge_dead': {FORCES[0]},
    'accelerometer_misalignment': {AXES[0], AXES[2]},
    'axis_inverted': {AXES[0]},
    'channel_swap': {FORCES[0], FORCES[1]},
    'clock_drift': {*FORCES, *AXES},
    'mains_hum': {FORCES[0], FORCES[3]},
    'data_gap': {FORCES[0], FORCES[1]},
    'sensor_spikes': {FORCES[0]},
}


@pytest.mark.parametrize('name', MEASUREMENT_CAUSES)
@pytest.mark.parametrize('seed', [None, 8])
def test_only_the_named_channels_change(name, seed, run):
    item = trials.deviation(name, trials.example(name))
    changed = touched(recorded(run, item, seed=seed), recorded(run, seed=seed))
    if name == 'accelerometer_misalignment' and seed is not None:
        assert changed <= set(AXES)  # the drawn rotation is replaced, about all axes
    elif name == 'clock_drift' and seed is not None:
        # its draws of latency differ in number, so that all later draws do
        assert changed >= EXPECTED[name]
    else:
        assert changed == EXPECTED[name]


def test_a_gain_is_a_factor(run):
    item = trials.deviation('gauge_gain', {'link': 'left_a'}, factor=0.91)
    plain = recorded(run).signals[FORCES[0]]
    assert recorded(run, item).signals[FORCES[0]].parts == pytest.approx(0.91 * plain.parts)
    # with real gauges the zero stays
    drawn, wrong = (recorded(run, *items, seed=2).signals[FORCES[0]] for items in ((), (item,)))
    slope = np.polyfit(drawn.parts[:, 1], wrong.parts[:, 1], 1)[0]
    assert slope == pytest.approx(0.91, abs=1e-3)


def test_creep_ends_at_its_strain_and_slows_down(run):
    item = trials.deviation('gauge_drift', {'link': 'left_a'})
    crept = recorded(run, item).signals[FORCES[0]].parts - recorded(run).signals[FORCES[0]].parts
    strain = crept / EA
    assert np.abs(strain[0]).max() < 1e-12
    assert strain[-1] == pytest.approx([1e-5] * 4, rel=1e-6)
    assert (np.diff(strain, axis=0) > 0.0).all()
    assert (np.diff(strain, 2, axis=0) < 1e-13).all()
    straight = trials.deviation('gauge_drift', {'link': 'left_a'}, curvature=0.0)
    line = (
        recorded(run, straight).signals[FORCES[0]].values - recorded(run).signals[FORCES[0]].values
    )
    assert line[len(line) // 2] / EA == pytest.approx(5e-6, rel=1e-3)


def test_a_dead_gauge_takes_a_quarter(run):
    item = Deviation('gauge_dead', {}, {'link': 'right_a', 'gauge': 3})
    plain, dead = (recorded(run, *items).signals[FORCES[2]] for items in ((), (item,)))
    assert np.ptp(dead.parts[:, 2]) == 0.0
    assert np.array_equal(dead.parts[:, [0, 1, 3]], plain.parts[:, [0, 1, 3]])
    assert np.polyfit(plain.values, dead.values, 1)[0] == pytest.approx(0.75, rel=1e-9)


def test_a_turned_sensor_sees_gravity_on_another_axis(run):
    """A rotation by +4 deg about y turns the sensor's x axis down: at rest it reads -9.81 sin."""
    columns = run.columns.copy()
    columns[:, 5:8] = [0.0, 0.0, 9.81]
    rest = replace(run, columns=columns)
    sine, cosine = np.sin(np.radians(4.0)), np.cos(np.radians(4.0))
    for axis, expected in (
        ('x', (0.0, 9.81 * sine, 9.81 * cosine)),
        ('y', (-9.81 * sine, 0.0, 9.81 * cosine)),
        ('z', (0.0, 0.0, 9.81)),
    ):
        angles = {f'{a}_deg': 4.0 * (a == axis) for a in 'xyz'}
        item = Deviation('accelerometer_misalignment', angles)
        signals = recorded(rest, item).signals
        assert [signals[c].values[7] for c in AXES] == pytest.approx(expected, abs=1e-12)


def test_misalignment_is_in_all(run):
    """What a recording's own tolerance would be does not come on top."""
    item = trials.deviation('accelerometer_misalignment')
    other, one = (recorded(run, item, seed=seed).signals[AXES[0]] for seed in (1, 2))
    n = min(len(one.values), len(other.values))
    difference = one.values[:n] - other.values[:n]
    assert np.ptp(difference - difference.mean()) < 0.3  # noise and clocks only


def test_an_inverted_axis_is_its_negative(run):
    item = Deviation('axis_inverted', {}, {'axis': 'z'})
    plain, wrong = (recorded(run, *items, seed=3).signals[AXES[2]] for items in ((), (item,)))
    assert np.array_equal(wrong.values, -plain.values)


def test_swapped_channels_hold_one_another(run):
    item = Deviation('channel_swap', {}, {'channels': ['left_b', 'link_force/right_a']})
    plain, wrong = recorded(run, seed=3).signals, recorded(run, item, seed=3).signals
    assert np.array_equal(wrong[FORCES[1]].parts, plain[FORCES[2]].parts)
    assert np.array_equal(wrong[FORCES[2]].parts, plain[FORCES[1]].parts)


@pytest.mark.parametrize(
    ('mains', 'seen'), [(50.0, 50.0), (60.0, 60.0), (150.0, 50.0), (180.0, 20.0)]
)
def test_hum_has_its_amplitude_and_folds_at_the_loggers_rate(mains, seen, run):
    item = trials.deviation('mains_hum', {'links': ['left_b']}, frequency_hz=mains)
    tone = recorded(run, item).signals[FORCES[1]].values - recorded(run).signals[FORCES[1]].values
    tone = tone[:8000] / EA
    lines = 2.0 * np.abs(np.fft.rfft(tone)) / len(tone)
    assert np.fft.rfftfreq(len(tone), 1 / 200.0)[lines.argmax()] == pytest.approx(seen)
    assert lines.max() == pytest.approx(6e-6, rel=1e-6)


def test_a_gap_takes_the_samples_of_its_time_and_topic(run):
    item = Deviation(
        'data_gap', {'from_s': 3.0, 'to_s': 7.0}, {'channels': ['step/acceleration/y']}
    )
    signals = recorded(run, item, seed=4).signals
    for channel in AXES:  # one topic, one gap
        since = (signals[channel].stamp_ns - signals[channel].stamp_ns[0]) * 1e-9
        assert not ((since >= 3.0) & (since < 7.0)).any()
        assert np.diff(since).max() == pytest.approx(4.0 + 0.005, abs=1e-6)
    assert len(signals[FORCES[0]].values) == len(signals[AXES[0]].values) + 800


def test_spikes_are_counted_isolated_and_far_out(run):
    item = trials.deviation('sensor_spikes', {'channel': 'tensioner/displacement'})
    plain, wrong = (
        recorded(run, *items, seed=5).signals['tensioner/displacement'] for items in ((), (item,))
    )
    off = np.abs(wrong.values - plain.values)
    places = np.flatnonzero(off)
    assert len(places) == 20
    assert np.diff(places).min() >= 2
    assert off[places] == pytest.approx([8.0 * plain.values.std()] * 20)
