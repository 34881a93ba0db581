"""Faults put into a recording are found where they are, and nothing else is."""

from dataclasses import replace

from faulty import EA, found, LEFT_A, MACHINE, only, TENSIONER, with_parts, Z
from makers import changed, Clocks, synthetic
import numpy as np
import pytest

from escalator_twin.check import check, quality
from escalator_twin.signals import Finding

pytestmark = pytest.mark.issue(2)


@pytest.fixture(scope='module')
def recording():
    return synthetic(MACHINE, 60.0)


@pytest.mark.parametrize('seed', range(5))
def test_nothing_is_found_in_nothing(seed):
    assert quality(synthetic(MACHINE, 40.0, seed), MACHINE) == []


def test_what_reading_found_is_kept(recording):
    finding = Finding('duplicate', LEFT_A, 0.0, 1.0, '3 messages', True)
    assert quality(replace(recording, findings=(finding,)), MACHINE) == [finding]


# sampling


def test_a_gap(recording):
    signal = recording.signals[LEFT_A]
    kept = np.ones(len(signal.values), dtype=bool)
    kept[4000:4800] = False
    broken = changed(
        recording,
        LEFT_A,
        stamp_ns=signal.stamp_ns[kept],
        bag_ns=signal.bag_ns[kept],
        parts=signal.parts[kept],
    )
    (finding,) = only(broken, 'data_gap')
    assert finding.from_s == pytest.approx(19.995, abs=0.01)
    assert finding.to_s == pytest.approx(24.0, abs=0.01)
    assert finding.detail == '800 samples missing'


@pytest.mark.parametrize(
    ('kept', 'span'), [(slice(800, None), (0, 4)), (slice(None, -800), (56, 60))]
)
def test_a_gap_at_an_end(recording, kept, span):
    s = recording.signals[LEFT_A]
    broken = changed(
        recording, LEFT_A, stamp_ns=s.stamp_ns[kept], bag_ns=s.bag_ns[kept], parts=s.parts[kept]
    )
    (finding,) = only(broken, 'data_gap')
    assert (finding.from_s, finding.to_s) == pytest.approx(span, abs=0.02)


def test_single_lost_messages_are_summed_up(recording):
    signal = recording.signals[LEFT_A]
    kept = np.ones(len(signal.values), dtype=bool)
    kept[[100, 2000, 2001, 9000]] = False
    broken = changed(
        recording,
        LEFT_A,
        stamp_ns=signal.stamp_ns[kept],
        bag_ns=signal.bag_ns[kept],
        parts=signal.parts[kept],
    )
    (finding,) = only(broken, 'data_gap')
    assert finding.detail == '4 samples missing in 3 short gaps'


def test_another_rate(recording):
    signal = recording.signals[TENSIONER]
    broken = changed(
        recording,
        TENSIONER,
        stamp_ns=signal.stamp_ns[::2],
        bag_ns=signal.bag_ns[::2],
        parts=signal.parts[::2],
    )
    (finding,) = only(broken, 'rate', TENSIONER)
    assert finding.detail == '50.00 Hz, expected 100 Hz'


def test_jitter(recording):
    signal = recording.signals[TENSIONER]
    rng = np.random.default_rng(5)
    stamps = signal.stamp_ns + rng.integers(-2_500_000, 2_500_000, len(signal.stamp_ns))
    only(changed(recording, TENSIONER, stamp_ns=stamps), 'jitter', TENSIONER)


# values


@pytest.mark.parametrize('hz', [50.0, 60.0, 49.85])
def test_mains_hum(recording, hz):
    def hum(parts):
        time = np.arange(len(parts)) / 200.0
        parts += 6e-6 * EA * np.sin(2 * np.pi * hz * time)[:, None]

    (finding,) = only(with_parts(recording, LEFT_A, hum), 'mains_hum')
    assert f'mains of {round(hz, -1):g} Hz' in finding.detail
    amplitude = float(finding.detail.split('a tone of ')[1].split(' ')[0])
    assert amplitude == pytest.approx(6e-6, rel=0.1)  # Hann: -0.7 dB between two bins at worst


@pytest.mark.parametrize('alias', [40.0])
def test_an_alias_of_the_mains(recording, alias):
    """60 Hz at 100 samples a second."""

    def hum(parts):
        parts += 1e-4 * np.sin(2 * np.pi * alias * np.arange(len(parts)) / 100.0)[:, None]

    (finding,) = only(with_parts(recording, TENSIONER, hum), 'mains_hum', TENSIONER)
    assert 'at 40.00 Hz: mains of 60 Hz' in finding.detail


def test_a_creeping_link():
    """Two loops at 0.5 m/s; the others have thermal drift that is within bounds."""
    recording = synthetic(MACHINE, 100.0)
    for i, name in enumerate(('left_a', 'left_b', 'right_a', 'right_b')):
        strain = (10e-6, 1.5e-6, -1.5e-6, 1e-6)[i]

        def creep(parts, strain=strain):
            parts += EA * strain * np.linspace(0.0, 1.0, len(parts))[:, None]

        recording = with_parts(recording, f'link_force/{name}', creep)
    (finding,) = only(recording, 'gauge_drift')
    assert float(finding.detail.split()[2]) == pytest.approx(10e-6, rel=0.2)


def test_a_clock_that_drifts_too_much_or_is_far_off():
    drifting = synthetic(MACHINE, 30.0, clocks=Clocks(0.5, 900.0))
    assert found(drifting) == {('clock_drift', '')}
    off = synthetic(MACHINE, 30.0, clocks=Clocks(-7000.0, 10.0))
    assert found(off) == {('clock_disagreement', '')}


def test_everything_at_once_is_told_apart(recording):
    def several(parts):
        parts[:, 0] = 0.0
        parts[[1000, 2000], 1] += 30e-6 * EA

    broken = with_parts(recording, LEFT_A, several)
    broken = with_parts(broken, Z, lambda parts: np.clip(parts, -3.0, 3.0, out=parts))
    assert found(broken) == {('gauge_dead', LEFT_A), ('sensor_spikes', LEFT_A), ('saturation', Z)}


def test_an_ideal_signal_may_stand_still(recording):
    """A simulation without noise is no dead sensor."""
    signal = recording.signals[TENSIONER]
    time = np.arange(len(signal.values)) / 100.0
    parts = 1e-5 * np.round(100 * np.sin(0.3 * time) * np.maximum(np.sin(0.1 * time), 0.0))
    assert found(changed(recording, TENSIONER, parts=parts)) == set()


@pytest.mark.shared
@pytest.mark.parametrize('name', ['clean_1', 'clean_2', 'drive_ripple', 'roller_eccentricity'])
def test_the_shared_recordings_have_no_fault_of_measurement(shared, name):
    document = check(shared / 'measured' / 'seeded' / name, MACHINE)
    assert document['schema'] == 'escalator_twin/check/1'
    assert document['quality'] == []
    assert all(row['found'] and row['expected'] for row in document['topics'])
    assert len(document['topics']) == 7
    assert document['container'] == {'files': [f'{name}.mcap'], 'losses': [], 'notes': []}
