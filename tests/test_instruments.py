"""Instruments against what the description promises, on analytic signals."""

from dataclasses import replace

import numpy as np
import pytest
import trials

from escalator_twin.errors import RecordingError
from escalator_twin.instruments import draw, ideal, record, recorded_sensors
from escalator_twin.machine import Logger, Machine
from escalator_twin.physics.rollout import Trace
from escalator_twin.signals import Recording

pytestmark = pytest.mark.issue(3)

START_NS = 1_700_000_000_000_000_123
SECONDS = 40.0  # of trials.analytic


def column(run: Trace, machine: Machine, channel: str) -> np.ndarray:
    index = [s.channel for s in recorded_sensors(machine)].index(channel)
    return run.columns[:, index]


def error(recording: Recording, run: Trace, machine: Machine, channel: str, rate: float = 1.0):
    """Return readings less truth at the true times of the samples, one column a field."""
    signal = recording.signals[channel]
    own_s = (signal.stamp_ns - signal.stamp_ns[0]) * 1e-9
    truth = np.interp(own_s / rate, run.time_s, column(run, machine, channel))
    return signal.parts - truth[:, None]


@pytest.fixture(scope='module')
def machine():
    return trials.prototype()


@pytest.fixture(scope='module')
def run(machine):
    return trials.analytic(machine)


@pytest.fixture(scope='module')
def still(machine):
    """Return the prototype with clocks that do not drift."""
    instruments = machine.instruments
    loggers = {name: Logger(clock.offset_s, 0.0) for name, clock in instruments.loggers.items()}
    return replace(machine, instruments=replace(instruments, loggers=loggers))


def test_ideal_instruments_are_exact_on_one_clock(machine, run):
    recording = ideal(run, machine, start_ns=START_NS)
    assert list(recording.signals) == [s.channel for s in recorded_sensors(machine)]
    for sensor in recorded_sensors(machine):
        signal = recording.signals[sensor.channel]
        stride = round(1000.0 / sensor.rate_hz)
        truth = column(run, machine, sensor.channel)[::stride]
        assert signal.parts.shape == (len(truth), len(sensor.fields))
        assert np.array_equal(signal.parts, np.repeat(truth[:, None], len(sensor.fields), axis=1))
        assert signal.values == pytest.approx(truth, rel=1e-15)
        assert signal.stamp_ns[0] == START_NS
        assert np.array_equal(signal.stamp_ns, signal.bag_ns)
        assert set(np.diff(signal.stamp_ns)) == {round(1e9 / sensor.rate_hz)}


def test_a_trace_without_the_extra_columns_is_enough(machine, run):
    n = len(machine.instruments.sensors)
    short = replace(run, columns=run.columns[:, :n])
    assert list(ideal(short, machine).signals) == [s.channel for s in machine.instruments.sensors]
    with pytest.raises(RecordingError, match=r'expected 8 columns .* or 20 .*, found 3'):
        ideal(replace(run, columns=run.columns[:, :3]), machine)


def test_a_seed_is_a_recording(machine, run):
    one, same, other = (record(run, machine, seed=seed) for seed in (4, 4, 5))
    for channel, signal in one.signals.items():
        assert np.array_equal(signal.parts, same.signals[channel].parts)
        assert np.array_equal(signal.bag_ns, same.signals[channel].bag_ns)
    assert not np.array_equal(
        one.signals['link_force/left_a'].parts[:100],
        other.signals['link_force/left_a'].parts[:100],
    )


def test_noise_and_resolution_are_the_descriptions(still, run):
    recording = record(run, still, seed=1)
    for sensor in still.instruments.sensors:
        if sensor.quantity != 'carriage_displacement':
            continue
        wrong = error(recording, run, still, sensor.channel)
        expected = np.hypot(sensor.noise, sensor.resolution / np.sqrt(12.0))
        assert wrong.std() == pytest.approx(expected, rel=0.05)
    # gauges: what is left between neighbours holds no smooth part
    signal = recording.signals['link_force/left_a']
    jitter = np.diff(signal.parts / 7.56e7, 3, axis=0).std() / np.sqrt(20.0)
    assert jitter == pytest.approx(np.hypot(0.25e-6, 0.05e-6 / np.sqrt(12.0)), rel=0.05)
    steps = signal.parts / 7.56e7 / 0.05e-6
    assert np.abs(steps - np.round(steps)).max() < 1e-6


def test_zeros_gains_and_drifts_stay_within_the_data_sheet(machine):
    drawn = [draw(machine, np.random.default_rng(seed)) for seed in range(400)]
    errors = [d.sensors['link_force/left_a'] for d in drawn]
    zeros = np.concatenate([e.zero for e in errors]) / 7.56e7
    assert np.abs(zeros).max() <= 100e-6
    assert zeros.std() == pytest.approx(100e-6 / np.sqrt(3.0), rel=0.1)
    gains = np.array([e.gain for e in errors])
    assert (gains - 1.0).std() == pytest.approx(0.003, rel=0.15)
    assert np.array_equal(gains[:, 0], gains[:, 3])  # of the whole sensor
    part = np.linspace(0.0, 1.0, 50)
    course = np.stack([2 * part - 1, np.cos(2 * np.pi * part), np.sin(2 * np.pi * part)])
    drift = np.array([e.thermal @ course for e in errors]) / 7.56e7
    assert 1e-6 < np.abs(drift).max() <= 2e-6
    turns = np.array([d.rotations_rad['step'] for d in drawn])
    assert np.rad2deg(turns).std() == pytest.approx(0.3, rel=0.1)
    offsets = np.array([d.clocks['on_board'] for d in drawn])
    assert np.abs(offsets).max(axis=0) == pytest.approx([2.0, 50.0], rel=0.05)
    assert all(d.clocks['ground'] == (0.0, 0.0) for d in drawn)


def test_clocks_tick_on_their_own(machine, run):
    rate = 1.0 + 900e-6
    item = trials.deviation('clock_drift', ppm=900.0)
    recording = record(run, machine, seed=7, deviations=(item,), start_ns=START_NS)
    fast, ground = (
        recording.signals[c] for c in ('step/acceleration/x', 'tensioner/displacement')
    )
    assert set(np.diff(fast.stamp_ns)) == {5_000_000}
    assert set(np.diff(ground.stamp_ns)) == {10_000_000}
    assert ground.stamp_ns[0] == START_NS
    assert abs(fast.stamp_ns[0] - START_NS) <= 2_000_000_000
    # more samples in the same time, and stamps that run ahead of bag time
    assert len(fast.values) == pytest.approx(SECONDS * 200.0 * rate, abs=1)
    ahead = np.polyfit(fast.bag_ns - START_NS, fast.stamp_ns - fast.bag_ns, 1)[0]
    assert ahead == pytest.approx(900e-6, rel=0.02)
    # a sample is the signal at its true time, to the spline's error and the noise
    wrong = error(recording, run, machine, 'tensioner/displacement')
    assert wrong.std() == pytest.approx(2e-5, rel=0.1)


def test_the_recorder_stamps_a_little_later_in_order(machine, run):
    recording = record(run, machine, seed=2, start_ns=START_NS)
    late = (recording.signals['tensioner/displacement'].bag_ns - START_NS) * 1e-9
    late -= np.arange(len(late)) / 100.0
    assert late.min() >= 0.004 - 1e-9
    assert late.mean() == pytest.approx(0.0048, abs=2e-4)
    for signal in recording.signals.values():
        assert (np.diff(signal.bag_ns) >= 0).all()


def test_channels_of_a_topic_and_of_a_logger_share_their_stamps(machine, run):
    signals = record(run, machine, seed=3).signals
    axes = [signals[f'step/acceleration/{axis}'] for axis in 'xyz']
    for other in (*axes[1:], signals['link_force/right_b']):
        assert np.array_equal(axes[0].stamp_ns, other.stamp_ns)
        assert np.array_equal(axes[0].bag_ns, other.bag_ns)


def test_bending_shows_on_the_edges_and_cancels_in_the_mean(still, run):
    signal = record(run, still, seed=6).signals['link_force/left_b']
    bend = column(run, still, 'roller/axle_30_left') + column(run, still, 'roller/axle_31_left')
    bend = 3e-9 * 7.56e7 * bend[::5]
    upper, lower = signal.parts[:, [0, 2]].mean(axis=1), signal.parts[:, [1, 3]].mean(axis=1)
    seen = np.polyfit(bend, (upper - lower) / 2.0, 1)[0]
    assert seen == pytest.approx(1.0, rel=0.01)
    force = column(run, still, 'link_force/left_b')[::5]
    both = np.linalg.lstsq(
        np.column_stack([force, bend, np.ones(len(bend))]), signal.values, rcond=None
    )[0]
    assert both[0] == pytest.approx(1.0, abs=0.012)  # four deviations of its gain
    assert both[1] == pytest.approx(0.0, abs=0.03)


def test_another_machine_records_in_its_own_units():
    toy = trials.toy()
    run = trials.analytic(toy, seconds=20.0)
    recording = record(run, toy, seed=1)
    assert set(recording.signals) == {
        'chain/pull',
        'take_up/way',
        'plate/shock/x',
        'plate/shock/z',
    }
    pull = recording.signals['chain/pull']
    assert pull.rate_hz == pytest.approx(100.0, rel=1e-3)
    truth = column(run, toy, 'chain/pull')[::10]
    n = min(len(truth), len(pull.values))
    wrong = pull.values[:n] - truth[:n]
    assert abs(wrong.mean()) <= 50.0 + 1.0  # 0.05 kN of zero
    assert wrong.std() == pytest.approx(2.0, rel=0.15)  # 0.002 kN of noise
    exact = ideal(run, toy).signals['take_up/way']
    assert np.array_equal(exact.values, column(run, toy, 'take_up/way')[::20])
