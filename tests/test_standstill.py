"""A bag that begins before the machine runs, and ends after it, is compared on what ran."""

from dataclasses import replace
import json

from makers import prototype
import numpy as np
import pytest

from escalator_twin import bagfile, pipeline
from escalator_twin.comparison.document import recording_document
from escalator_twin.comparison.standstill import without_standstill
from escalator_twin.ros.windows import recorder_shift_ns
from escalator_twin.signals import make_signal

pytestmark = pytest.mark.issue(5)


MACHINE = prototype()


@pytest.fixture(scope='module')
def sample(root):
    return bagfile.read(root / 'bags' / 'sample_clean', MACHINE)


def at_rest(recording, before_s, after_s):
    """Return the recording with the machine at rest before and after: the values it had, with noise."""
    rng = np.random.default_rng(6)
    signals = {}
    for channel, old in recording.signals.items():
        sensor = MACHINE.instruments.sensor(channel)
        step = round(1e9 / sensor.rate_hz)
        noise = sensor.noise * abs(sensor.scale)

        def still(like, seconds, sensor=sensor, noise=noise):
            shape = (round(seconds * sensor.rate_hz), len(like))
            return like + noise * rng.normal(size=shape)

        parts = [still(old.parts[0], before_s), old.parts, still(old.parts[-1], after_s)]
        times = {}
        for name in ('stamp_ns', 'bag_ns'):
            was = getattr(old, name)
            first = was[0] - step * np.arange(len(parts[0]), 0, -1)
            last = was[-1] + step * np.arange(1, len(parts[2]) + 1)
            times[name] = np.concatenate([first, was, last])
        signals[channel] = make_signal(channel, old.unit, parts=np.concatenate(parts), **times)
    return replace(recording, signals=signals)


def test_what_runs_all_the_time_is_left_as_it_is(sample):
    assert without_standstill(sample, MACHINE) == (sample, [])


@pytest.mark.parametrize(('before', 'after'), [(12.0, 0.0), (0.0, 7.0), (5.0, 20.0)])
def test_rest_is_left_out_and_told(sample, before, after):
    whole = at_rest(sample, before, after)
    cut, findings = without_standstill(whole, MACHINE)
    assert [f.kind for f in findings] == ['data_gap'] * ((before > 0.0) + (after > 0.0))
    assert all(f.repaired and not f.channel for f in findings)
    for channel, ran in sample.signals.items():
        there = cut.signals[channel].bag_ns
        # nothing of the rest, and of the run no more than a start and a stop take
        assert ran.bag_ns[0] - 1e8 <= there[0] <= ran.bag_ns[0] + (4.5e9 if before else 1e8)
        assert ran.bag_ns[-1] + 1e8 >= there[-1] >= ran.bag_ns[-1] - (4.5e9 if after else 1e8)
        inside = np.isin(ran.bag_ns, there)
        assert np.array_equal(cut.signals[channel].values, ran.values[inside])


def test_a_short_rest_is_none(sample):
    assert not without_standstill(at_rest(sample, 1.5, 1.5), MACHINE)[1]


def test_a_machine_that_never_runs_is_left_to_what_finds_its_speed(sample):
    rest = {c: replace(s, values=0.0 * s.values) for c, s in sample.signals.items()}
    still = replace(sample, signals=rest)
    assert without_standstill(still, MACHINE) == (still, [])


def test_speed_place_and_agreement_are_those_of_the_run(root, sample):
    truth = json.loads((root / 'bags' / 'truth' / 'sample_clean.json').read_text())
    whole = at_rest(sample, 8.0, 8.0)
    setting, judgement = pipeline.compare_recording(whole, MACHINE)
    found = recording_document(whole, setting, judgement, MACHINE)
    assert found['speed_m_s']['value'] == pytest.approx(truth['speed_m_s'], rel=1e-3)
    told = [f for f in found['quality'] if f['kind'] == 'data_gap']
    assert [f['channel'] for f in told] == ['', '']
    for channel, row in found['channels'].items():
        if 'acceleration/y' not in channel:
            assert row['r_time'] > 0.999, channel


def test_the_recorders_time_is_told_at_the_origin_though_a_standstill_is_before_it(sample):
    whole = at_rest(sample, 8.0, 0.0)
    cut, _ = without_standstill(whole, MACHINE)
    first = cut.signals['tensioner/displacement']
    origin = int(first.stamp_ns[0])
    assert origin > int(whole.signals['tensioner/displacement'].stamp_ns[0])
    assert recorder_shift_ns(whole, origin) == int(first.bag_ns[0]) - origin != 0
    assert recorder_shift_ns(whole, origin + 1) == 0
