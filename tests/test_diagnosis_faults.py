"""Faults of the measurement, put into recordings, are told with their place and size."""

from types import SimpleNamespace

from makers import changed, prototype, synthetic
import numpy as np
import pytest

from escalator_twin.bagfile.reading import NO_NUMBERS
from escalator_twin.check import quality
from escalator_twin.check.clock import ClockComparison
from escalator_twin.check.gaps import MORE, SHORT
from escalator_twin.diagnosis.context import noises_of
from escalator_twin.diagnosis.faults import faults_of
from escalator_twin.signals import Finding

pytestmark = pytest.mark.issue(6)

MACHINE = prototype()
LEFT_A, RIGHT_B = 'link_force/left_a', 'link_force/right_b'
Z = 'step/acceleration/z'
EA = 7.56e7  # N, data sheet


@pytest.fixture(scope='module')
def recording():
    return synthetic(MACHINE, 60.0)


def told(findings=(), **clocks):
    return faults_of(SimpleNamespace(findings=tuple(findings), comparisons=clocks), MACHINE)


def seen(recording):
    return told(quality(recording, MACHINE))


def holds(fault, name, truth):
    value, low, high = fault.parameters[name]
    return low <= truth <= high and low <= value <= high


def without(recording, channel, start_s, end_s):
    signal = recording.signals[channel]
    seconds = (signal.stamp_ns - signal.stamp_ns[0]) / 1e9
    kept = (seconds < start_s) | (seconds >= end_s)
    return changed(
        recording, channel, stamp_ns=signal.stamp_ns[kept], bag_ns=signal.bag_ns[kept],
        parts=signal.parts[kept],
    )  # fmt: skip


def test_nothing_is_told_of_nothing(recording):
    assert seen(recording) == []


def test_a_dead_gauge(recording):
    parts = np.array(recording.signals[LEFT_A].parts)
    parts[:, 2] = parts[0, 2]
    (fault,) = seen(changed(recording, LEFT_A, parts=parts))
    assert fault.cause == 'gauge_dead'
    assert fault.location == {'link': 'left_a', 'gauge': 3}


def test_hum_of_two_links_is_one_fault(recording):
    strain = 6e-6
    loud = recording
    for channel in (LEFT_A, RIGHT_B):
        signal = loud.signals[channel]
        tone = EA * strain * np.sin(2.0 * np.pi * 50.0 * signal.stamp_ns / 1e9)
        loud = changed(loud, channel, parts=np.array(signal.parts) + tone[:, None])
    (fault,) = seen(loud)
    assert fault.cause == 'mains_hum'
    assert set(fault.location['links']) == {'left_a', 'right_b'}
    assert holds(fault, 'strain', strain)
    assert holds(fault, 'frequency_hz', 50.0)


def test_a_gap_of_two_channels_is_one_fault(recording):
    broken = recording
    for channel in (LEFT_A, RIGHT_B):
        broken = without(broken, channel, 20.0, 24.0)
    (fault,) = seen(broken)
    assert fault.cause == 'data_gap'
    assert set(fault.location['channels']) == {LEFT_A, RIGHT_B}
    assert holds(fault, 'from_s', 20.0)
    assert holds(fault, 'to_s', 24.0)


def test_gaps_at_two_times_are_two(recording):
    broken = without(without(recording, LEFT_A, 20.0, 24.0), RIGHT_B, 40.0, 44.0)
    assert [fault.location['channels'] for fault in seen(broken)] == [[LEFT_A], [RIGHT_B]]


def test_samples_lost_here_and_there_are_no_gap_from_the_first_to_the_last(recording):
    """Nor are those that are no numbers, or more gaps than are told one by one: the findings tell them."""
    signal = recording.signals[LEFT_A]
    there = np.random.default_rng(2).random(len(signal.values)) > 0.05
    names = ('stamp_ns', 'bag_ns', 'parts')
    columns = {name: getattr(signal, name)[there] for name in names}
    lossy = changed(recording, LEFT_A, **columns)
    assert any(SHORT in finding.detail for finding in quality(lossy, MACHINE))
    assert seen(lossy) == []
    texts = [f'12 samples {NO_NUMBERS}: dropped', f'3 {MORE}']
    assert told([Finding('data_gap', LEFT_A, 0.0, 60.0, text) for text in texts]) == []


def test_spikes(recording):
    signal = recording.signals[Z]
    parts = np.array(signal.parts)
    rng = np.random.default_rng(4)
    where = rng.choice(len(parts), 20, replace=False)
    parts[where, 0] += rng.choice([-1.0, 1.0], 20) * rng.uniform(8.0, 20.0, 20)
    (fault,) = seen(changed(recording, Z, parts=parts))
    assert fault.cause == 'sensor_spikes'
    assert fault.location == {'channel': Z}
    assert holds(fault, 'count', 20)


def test_an_inverted_axis_and_exchanged_channels():
    inverted = Finding('axis_inverted', Z, 0.0, 60.0, 'reads with the wrong sign', True)
    swapped = Finding('channel_swap', LEFT_A, 0.0, 60.0, f'exchanged with {RIGHT_B}', True)
    one, other = told([inverted, swapped])
    assert (one.cause, one.location) == ('axis_inverted', {'axis': 'z'})
    assert (other.cause, other.location) == ('channel_swap', {'channels': [LEFT_A, RIGHT_B]})


def test_an_inverted_link_is_no_cause_of_the_list():
    assert (
        told([Finding('axis_inverted', LEFT_A, 0.0, 60.0, 'reads with the wrong sign', True)])
        == []
    )


def test_where_plugs_are_exchanged_a_gauges_fault_is_told_of_its_link():
    """The recorded channel holds the other link's gauges; what the channel lost stays its own."""
    span = (0.0, 60.0)
    found = [
        Finding('gauge_dead', LEFT_A, *span, 'part 3 of 4 reads a constant', True),
        Finding('mains_hum', RIGHT_B, *span, 'tone of 6e-6 at 50 Hz, mains of 50 Hz', True),
        Finding('data_gap', LEFT_A, 10.0, 14.0, 'no samples', True),
    ]
    plain = {f.cause: f.location for f in told(found)}
    swap = Finding('channel_swap', LEFT_A, *span, f'exchanged with {RIGHT_B}', True)
    turned = {f.cause: f.location for f in told([*found, swap])}
    assert plain['gauge_dead'] == {'link': 'left_a', 'gauge': 3}
    assert turned['gauge_dead'] == {'link': 'right_b', 'gauge': 3}
    assert (plain['mains_hum'], turned['mains_hum']) == (
        {'links': ['right_b']},
        {'links': ['left_a']},
    )
    assert plain['data_gap'] == turned['data_gap'] == {'channels': [LEFT_A]}


def test_where_plugs_are_exchanged_a_repaired_gauges_noise_goes_where_its_signal_is_compared():
    dead = Finding(
        'gauge_dead', LEFT_A, 0.0, 60.0, 'part 3 of 4 reads a constant', True, noise=1.4
    )
    swap = Finding('channel_swap', LEFT_A, 0.0, 60.0, f'exchanged with {RIGHT_B}', True)
    assert noises_of([dead]) == {LEFT_A: 1.4}
    assert noises_of([dead, swap]) == {RIGHT_B: 1.4}


def comparison(ppm, half):
    return ClockComparison('on_board', 'ground', 0.6, 0.5, 0.7, ppm, ppm - half, ppm + half)


def test_a_drifting_clock():
    (fault,) = told(on_board=comparison(900.0, 5.0))
    assert (fault.cause, fault.location) == ('clock_drift', {})
    assert fault.parameters['ppm'] == pytest.approx((900.0, 895.0, 905.0))
    (slow,) = told(on_board=comparison(-300.0, 5.0))
    assert slow.parameters['ppm'][0] == pytest.approx(-300.0)


@pytest.mark.parametrize('ppm', [-60.0, -22.0, 0.0, 22.0, 60.0])
def test_a_clock_within_three_tolerances_is_no_fault(ppm):
    assert told(on_board=comparison(ppm, 1.0)) == []


def test_a_clock_that_nobody_could_compare_is_no_fault():
    assert told(on_board=ClockComparison('on_board', 'ground')) == []


def test_what_is_no_fault_of_the_list_is_not_told():
    kinds = ('rate', 'jitter', 'duplicate', 'out_of_order', 'saturation', 'missing_topic')
    assert told(Finding(kind, LEFT_A, 0.0, 1.0, 'some') for kind in kinds) == []
