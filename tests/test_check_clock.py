"""Clock offset and drift by bag time: within bounds, with intervals, or not at all."""

from dataclasses import replace

from makers import changed, Clocks, prototype, START_NS, synthetic
import numpy as np
import pytest

from escalator_twin import bagfile
from escalator_twin.check import compare_clocks
from escalator_twin.signals import make_signal, Recording

pytestmark = pytest.mark.issue(2)

MACHINE = prototype()
ON_BOARD = [s.channel for s in MACHINE.instruments.sensors if s.logger == 'on_board']


def with_bag_times(recording, change):
    """Return the recording with each signal's bag time (s from the start) put through a function."""
    signals = {}
    for name, s in recording.signals.items():
        seconds = (s.bag_ns - START_NS) / 1e9
        bag_ns = START_NS + np.rint(change(seconds, s) * 1e9).astype(np.int64)
        signals[name] = make_signal(name, s.unit, s.stamp_ns, bag_ns, s.parts)
    return Recording('', signals, recording.experiment)


@pytest.mark.parametrize('seed', range(6))
@pytest.mark.parametrize(('offset_s', 'drift_ppm'), [(0.6, 22.0), (-1.9, -50.0), (0.0, 900.0)])
def test_offset_and_drift_lie_in_their_intervals(seed, offset_s, drift_ppm):
    recording = synthetic(MACHINE, 60.0, seed, Clocks(offset_s, drift_ppm))
    clock = compare_clocks(recording, MACHINE)
    assert clock.offset_s == pytest.approx(offset_s, abs=2e-4)
    assert clock.drift_ppm == pytest.approx(drift_ppm, abs=5.0)
    # 95 % of one: the six seeds must hold it with a little room
    assert clock.offset_low_s - 5e-5 < offset_s < clock.offset_high_s + 5e-5
    assert clock.drift_low_ppm - 1.0 < drift_ppm < clock.drift_high_ppm + 1.0
    assert clock.offset_high_s - clock.offset_low_s < 1e-3


def test_a_short_recording_says_how_little_it_knows():
    long = compare_clocks(synthetic(MACHINE, 60.0), MACHINE)
    short = compare_clocks(synthetic(MACHINE, 6.0), MACHINE)
    width = [c.drift_high_ppm - c.drift_low_ppm for c in (long, short)]
    assert width[1] > 5.0 * width[0]
    assert short.drift_low_ppm < 22.0 < short.drift_high_ppm


@pytest.mark.parametrize('jump_s', [30.0, -20.0, 0.5])
def test_a_jump_of_the_recorders_clock_is_undone_and_told(jump_s):
    def jumping(seconds, _):
        return 1000.0 + seconds + jump_s * (seconds > 31.0)

    clock = compare_clocks(with_bag_times(synthetic(MACHINE, 60.0), jumping), MACHINE)
    assert clock.offset_s == pytest.approx(0.6, abs=5e-4)
    assert clock.drift_ppm == pytest.approx(22.0, abs=5.0)
    assert any('jumps' in text for text in clock.remarks)


def test_stalls_of_the_recorder_do_not_matter():
    def stalling(seconds, _):
        late = seconds.copy()
        for begin in (10.0, 35.0):
            held = (seconds > begin) & (seconds < begin + 1.5)
            late[held] = begin + 1.5 + 1e-5 * np.arange(held.sum())
        return late

    clock = compare_clocks(with_bag_times(synthetic(MACHINE, 60.0), stalling), MACHINE)
    assert clock.offset_s == pytest.approx(0.6, abs=1e-3)
    assert clock.drift_ppm == pytest.approx(22.0, abs=5.0)


@pytest.mark.parametrize('rate', [0.5, 10.0])
def test_a_replay_at_another_rate_recorded_again_still_tells(rate):
    def replayed(seconds, signal):
        rng = np.random.default_rng(len(signal.channel))
        return 5e5 + seconds / rate + rng.exponential(2e-4, len(seconds))

    clock = compare_clocks(with_bag_times(synthetic(MACHINE, 60.0), replayed), MACHINE)
    assert clock.offset_s == pytest.approx(0.6, abs=5e-3)
    assert clock.drift_ppm == pytest.approx(22.0, abs=5.0 * max(rate, 1.0))


def test_a_bag_time_made_from_the_stamps_tells_nothing():
    recording = synthetic(MACHINE, 20.0)
    signals = {
        n: make_signal(n, s.unit, s.stamp_ns, s.stamp_ns, s.parts)
        for n, s in recording.signals.items()
    }
    clock = compare_clocks(replace(recording, signals=signals), MACHINE)
    assert not clock.is_known
    assert clock.drift_ppm is None
    assert 'bag time equals the stamps' in clock.reason


def test_without_one_of_the_loggers_nothing_is_known():
    recording = synthetic(MACHINE, 20.0)
    signals = {n: s for n, s in recording.signals.items() if n in ON_BOARD}
    clock = compare_clocks(replace(recording, signals=signals), MACHINE)
    assert not clock.is_known
    assert clock.reason == 'no messages of the logger ground'


def test_one_logger_has_no_other():
    loggers = {'ground': MACHINE.instruments.loggers['ground']}
    machine = replace(MACHINE, instruments=replace(MACHINE.instruments, loggers=loggers))
    assert 'one logger' in compare_clocks(synthetic(MACHINE, 5.0), machine).reason


def test_a_second_of_recording_is_too_short():
    clock = compare_clocks(synthetic(MACHINE, 1.0), MACHINE)
    assert not clock.is_known
    assert 'too few' in clock.reason


def test_a_sensor_missing_from_the_middle_does_not_matter():
    recording = synthetic(MACHINE, 60.0)
    for channel in ON_BOARD:
        signal = recording.signals[channel]
        kept = np.ones(len(signal.values), dtype=bool)
        kept[4000:7000] = False
        recording = changed(
            recording,
            channel,
            stamp_ns=signal.stamp_ns[kept],
            bag_ns=signal.bag_ns[kept],
            parts=signal.parts[kept],
        )
    clock = compare_clocks(recording, MACHINE)
    assert clock.offset_s == pytest.approx(0.6, abs=5e-4)


@pytest.mark.shared
@pytest.mark.parametrize(
    ('name', 'offset_s', 'drift_ppm'), [('clean_1', 0.6, 22.0), ('clean_2', None, None)]
)
def test_the_shared_recordings(shared, name, offset_s, drift_ppm):
    recording = bagfile.read(shared / 'measured' / 'seeded' / name, MACHINE)
    clock = compare_clocks(recording, MACHINE)
    first = recording.signals['step/acceleration/x'].stamp_ns[0]
    ground = recording.signals['tensioner/displacement'].stamp_ns[0]
    # both loggers' first samples are taken at the same instant
    assert clock.offset_s == pytest.approx((first - ground) / 1e9, abs=1e-3)
    if offset_s is not None:
        assert clock.offset_s == pytest.approx(offset_s, abs=5e-3)
        assert clock.drift_ppm == pytest.approx(drift_ppm, abs=5.0)
