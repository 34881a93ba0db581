"""Faults put into values of a channel are found, and what only looks like one is none."""

from faulty import EA, found, LEFT_A, MACHINE, only, TENSIONER, with_parts, Z
from makers import synthetic
import numpy as np
import pytest

from escalator_twin import bagfile
from escalator_twin.check import quality
from escalator_twin.check.gaps import longest_live_run
from escalator_twin.check.parts import own_noise, Part
from escalator_twin.check.spikes import independent
from escalator_twin.check.values import _tone, spike_mask

pytestmark = pytest.mark.issue(2)


@pytest.fixture(scope='module')
def recording():
    return synthetic(MACHINE, 60.0)


def test_a_dead_gauge(recording):
    def kill(parts):
        parts[:, 2] = 12e-6 * EA

    (finding,) = only(with_parts(recording, LEFT_A, kill), 'gauge_dead')
    assert finding.detail == 'part 3 of 4 reads a constant (1.2e-05)'
    assert finding.to_s == pytest.approx(60.0, abs=0.1)


def test_a_gauge_that_dies_on_the_way(recording):
    def kill(parts):
        parts[6000:, 1] = parts[6000, 1]

    (finding,) = only(with_parts(recording, LEFT_A, kill), 'gauge_dead')
    assert finding.from_s == pytest.approx(30.0, abs=0.05)
    assert finding.detail.startswith('part 2 of 4')


def test_a_gauge_that_gives_noise_alone(recording):
    def kill(parts):
        rng = np.random.default_rng(5)
        parts[:, 0] = EA * np.round(rng.normal(0.0, 0.25e-6, len(parts)) / 5e-8) * 5e-8

    (finding,) = only(with_parts(recording, LEFT_A, kill), 'gauge_dead')
    assert finding.detail == 'part 1 of 4 does not follow part 3'


def test_a_channel_that_stands_still(recording):
    def hold(parts):
        parts[2000:2400] = parts[2000]

    (finding,) = only(with_parts(recording, TENSIONER, hold), 'data_gap', TENSIONER)
    assert float(finding.detail.split()[-2]) == pytest.approx(4.0, abs=0.05)
    assert finding.from_s == pytest.approx(20.0, abs=0.05)


def test_a_channel_that_stands_still_twice_has_two_gaps(recording):
    def hold(parts):
        parts[4000:4900] = parts[4000]
        parts[8000:8900] = parts[8000]

    held = with_parts(recording, LEFT_A, hold)
    assert [f.kind for f in quality(held, MACHINE) if f.channel == LEFT_A] == ['data_gap'] * 2


def test_a_channel_that_sticks_misses_nothing(recording):
    """Within its dead band it stands still, and goes on from there."""

    def stick(parts):
        half = 0.45 * np.ptp(parts, axis=0)
        for i in range(1, len(parts)):
            parts[i] = np.clip(parts[i - 1], parts[i] - half, parts[i] + half)

    stuck = with_parts(recording, LEFT_A, stick)
    assert not [f for f in quality(stuck, MACHINE) if f.kind == 'data_gap']


@pytest.mark.parametrize('edge', [1999, 2400])
def test_a_part_that_read_the_held_value_beside_the_standstill_is_not_dead(recording, edge):
    def hold(parts):
        parts[2000:2400] = parts[2000]
        parts[edge, 3] = parts[2000, 3]

    held = with_parts(recording, LEFT_A, hold)
    assert [f.kind for f in quality(held, MACHINE) if f.channel == LEFT_A] == ['data_gap']


@pytest.mark.issue(6)
@pytest.mark.parametrize('steps', [2.0, 40.0, 80.0])
def test_a_coarse_converter_is_no_fault_of_standing_still(recording, steps):
    """A signal stands on one of a coarse converter's steps where it is slow: no gap, dead gauge, spike or clipping.

    As it does on one of 40 standard deviations of its noise for seconds.
    """
    step = steps * 2.5e-7 * EA

    def round_off(parts):
        parts[:] = step * np.round(parts / step)

    assert quality(with_parts(recording, LEFT_A, round_off), MACHINE) == []


@pytest.mark.issue(6)
def test_what_stands_still_is_told_of_a_coarse_converter_too(recording):
    step = 40.0 * 2.5e-7 * EA

    def die(parts):
        parts[:] = step * np.round(parts / step)
        parts[len(parts) // 4 :, 1] = parts[len(parts) // 4, 1]

    findings = quality(with_parts(recording, LEFT_A, die), MACHINE)
    (finding,) = [f for f in findings if f.kind != 'saturation']
    assert finding.kind == 'gauge_dead'
    assert finding.detail.startswith('part 2 of 4')


@pytest.mark.issue(6)
def test_a_smooth_channel_repeats_itself_and_does_not_stand_still(recording):
    """Behind a slow filter a step's noise is a third of the converter's step."""
    rng = np.random.default_rng(3)

    def smooth(parts):
        noise = np.convolve(rng.normal(0.0, 0.02, len(parts) + 79), np.ones(80) / 80.0, 'valid')
        slow = 0.3 * np.sin(2.0 * np.pi * 0.1 * np.arange(len(parts)) / 200.0)
        parts[:, 0] = 0.01 * np.round((slow + noise) / 0.01)

    assert quality(with_parts(recording, Z, smooth), MACHINE) == []
    assert longest_live_run(0.02, 0.01, 10**4, 0.25) == longest_live_run(0.02, 0.01, 10**4)
    assert longest_live_run(0.02, 0.01, 10**4, 0.8) > 3 * longest_live_run(0.02, 0.01, 10**4)


def test_saturation(recording):
    def clip(parts):
        np.clip(parts, -3.0, 3.5, out=parts)

    findings = only(with_parts(recording, Z, clip), 'saturation', Z)
    assert {f.detail.split(' samples at ')[1] for f in findings} == {
        'the largest value, 3.5',
        'the smallest value, -3',
    }


def test_spikes(recording):
    where = np.random.default_rng(6).choice(np.arange(20, 11900, 40), 20, replace=False)

    def spike(parts):
        parts[where, 0] += np.where(where % 80 > 39, 1.0, -1.0)

    (finding,) = only(with_parts(recording, Z, spike), 'sensor_spikes', Z)
    assert finding.detail.startswith('20 isolated outliers, the largest of 1')


def test_a_spike_on_one_gauge_alone(recording):
    def spike(parts):
        parts[[500, 7000], 3] += 20e-6 * EA

    (finding,) = only(with_parts(recording, LEFT_A, spike), 'sensor_spikes')
    assert finding.detail.startswith('2 isolated outliers')


def test_ringing_impacts_are_no_spikes():
    time = np.arange(12000) / 200.0
    values = np.random.default_rng(1).normal(0.0, 0.02, 12000)
    for start in range(300, 11000, 81):
        rest = time[start:] - time[start]
        values[start:] += 4.0 * np.exp(-rest / 0.02) * np.cos(2 * np.pi * 55.0 * rest)
    assert not spike_mask(values, 0.02).any()


def with_impacts(recording, n, other=0.0, ring=0.0, every=500):
    """Return the recording with ``n`` jolts of z, which move x and ring as said."""
    rng = np.random.default_rng(3)
    where = every * np.arange(1, n + 1) + rng.integers(0, every // 3, n)

    def jolt(share):
        def change(parts):
            for i in where:
                parts[i, 0] += share
                parts[i + 1 : i + 13, 0] += (
                    ring * share * np.cos(2.5 * np.arange(12)) * 0.8 ** np.arange(12)
                )

        return change

    recording = with_parts(recording, Z, jolt(2.0))
    return with_parts(recording, 'step/acceleration/x', jolt(2.0 * other))


@pytest.mark.issue(5)
@pytest.mark.parametrize(('other', 'ring'), [(0.15, 0.0), (0.0, 0.15), (0.2, 0.2)])
def test_what_moves_other_axes_or_rings_is_an_impact(recording, other, ring):
    assert found(with_impacts(recording, 20, other, ring)) == set()
    assert found(with_impacts(recording, 20)) == {('sensor_spikes', Z)}


@pytest.mark.issue(5)
def test_a_few_hits_are_no_fault(recording):
    assert found(with_impacts(recording, 3)) == set()


@pytest.mark.issue(5)
def test_hits_that_recur_are_one():
    stamps = np.concatenate([[3_000], 10_000 + 760 * np.arange(5), [40_000]]) * 1_000_000
    assert independent(stamps) == 4
    assert independent(stamps[:0]) == 0


@pytest.mark.shared
@pytest.mark.issue(5)
@pytest.mark.parametrize('axis', ['x', 'y', 'z'])
@pytest.mark.parametrize('noises', [60.0, 400.0])
def test_outliers_among_impacts_are_found(shared, axis, noises):
    recording = bagfile.read(shared / 'measured' / 'seeded' / 'clean_1', MACHINE)
    channel = f'step/acceleration/{axis}'
    rng = np.random.default_rng(8)
    signal = recording.signals[channel]
    where = 2 * rng.permutation(len(signal.values) // 2)[:20]

    def spike(parts):
        parts[where, 0] += noises * 0.02 * rng.choice([-1.0, 1.0], 20)

    (finding,) = only(with_parts(recording, channel, spike), 'sensor_spikes', channel)
    assert 16 <= int(finding.detail.split()[0]) <= 24


@pytest.mark.issue(5)
@pytest.mark.parametrize('name', ['sample_clean', 'sample_guide_step'])
def test_impacts_of_the_sample_recordings_are_no_spikes(root, name):
    findings = quality(bagfile.read(root / 'bags' / name, MACHINE), MACHINE)
    assert 'sensor_spikes' not in {f.kind for f in findings}


def test_noise_by_second_differences():
    rng = np.random.default_rng(1)
    values = 30.0 * np.sin(np.arange(20000) / 300.0) + rng.normal(0.0, 0.5, 20000)
    assert own_noise(values) == pytest.approx(0.5, rel=0.03)
    assert own_noise(values[:3]) == 0.0


def test_live_noise_stands_still_as_rarely_as_said():
    """The longest run of equal rounded samples, counted, against the bound on it."""
    rng = np.random.default_rng(1)
    values = np.round(rng.normal(0.0, 0.02, 10**6) / 0.01)
    is_same = np.diff(values) == 0
    ends = np.flatnonzero(np.diff(np.concatenate([[0], is_same.astype(int), [0]])))
    longest = int((ends[1::2] - ends[::2]).max()) + 1
    assert 5 < longest < longest_live_run(0.02, 0.01, 10**6)


# the document


@pytest.mark.issue(6)
@pytest.mark.parametrize('hz', [49.93, 60.07])
def test_a_tone_is_as_large_as_its_samples_say_whatever_their_clock(hz):
    """Intervals of 4.9 and 5.15 ms: a grid by the most of them drifts past the samples."""
    rng = np.random.default_rng(8)
    time = np.cumsum(rng.permutation(np.repeat([4.9e-3, 5.15e-3], [12_000, 8_000])))
    values = 6e-6 * np.sin(2.0 * np.pi * hz * time) + rng.normal(0.0, 2e-7, len(time))
    frequency, amplitude, mains = _tone(Part(values, 2e-7, 0.0), time)
    assert mains == round(hz, -1)
    assert frequency == pytest.approx(hz, abs=1e-3)
    assert amplitude == pytest.approx(6e-6, rel=0.01)
