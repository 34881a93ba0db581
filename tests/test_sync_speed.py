"""Speed from signals whose speed and wander are known, and from the shared recordings."""

import numpy as np
import pytest

from escalator_twin.bagfile import read
from escalator_twin.errors import SynchronisationError
from escalator_twin.machine import load_machine
from escalator_twin.sync.speed import estimate_speed

PITCH = 0.405
N_LINKS = 60
LOOP = N_LINKS * PITCH

pytestmark = pytest.mark.issue(5)


def travel_of(time, speed, wander=0.002, period=47.0, phase=0.3):
    """Return travel with a slow wander of the speed about its mean."""
    w = 2 * np.pi / period
    return speed * (time + wander / w * (np.sin(w * time + phase) - np.sin(phase)))


def displacement(travel, rng, noise=2e-5):
    """Return what the tensioner's sensor reads: pitch and its multiples, noise, resolution."""
    theta = 2 * np.pi * (travel / PITCH + rng.uniform())
    values = 1.5e-3 * np.cos(theta) + 3.4e-4 * np.cos(2 * theta + 1.0) + 5e-5 * np.cos(4 * theta)
    values += 4e-4 * np.cos(theta / N_LINKS) + rng.uniform(-0.01, 0.01)
    values += noise * rng.normal(size=len(travel))
    return np.round(values / 1e-5) * 1e-5


def mean_speed(time, travel):
    return (travel[-1] - travel[0]) / (time[-1] - time[0])


@pytest.mark.parametrize('duration', [20.0, 60.0, 105.0, 400.0])
@pytest.mark.parametrize(('set_speed', 'error'), [(0.25, -0.068), (0.5, 0.03), (0.5, 0.07)])
def test_speed_and_travel_are_recovered(duration, set_speed, error):
    rng = np.random.default_rng(int(duration))
    time = np.arange(0.0, duration, 0.01)
    travel = travel_of(time, set_speed * (1 + error))
    found = estimate_speed(time + 1e3, displacement(travel, rng), PITCH, set_speed)
    assert found.value == pytest.approx(mean_speed(time, travel), rel=2e-4)
    assert found.low < found.value < found.high
    assert found.high - found.low < 2e-3 * found.value
    off = found.travel_m - (travel - travel[0])
    assert np.abs(off - np.median(off)).max() < 2e-3


def test_interval_covers_the_truth():
    covered, errors = [], []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        time = np.arange(0.0, 80.0, 0.01)
        travel = travel_of(
            time, 0.5 * (1 + rng.uniform(-0.07, 0.07)), 0.002, rng.uniform(30, 90), seed
        )
        found = estimate_speed(time, displacement(travel, rng, 2e-4), PITCH, 0.5)
        truth = mean_speed(time, travel)
        covered.append(found.low <= truth <= found.high)
        errors.append(abs(found.value / truth - 1))
    assert np.mean(covered) >= 0.85
    assert max(errors) < 1e-3


def test_gaps_spikes_and_jitter_do_not_matter():
    rng = np.random.default_rng(0)
    time = np.sort(np.arange(0.0, 100.0, 0.01) + 0.002 * rng.uniform(size=10000))
    travel = travel_of(time, 0.48)
    values = displacement(travel, rng)
    spikes = rng.integers(0, len(time), 20)
    values[spikes] += rng.choice([-1, 1], 20) * rng.uniform(1e-3, 1e-1, 20)
    values[2000:2400] = np.nan
    keep = np.ones(len(time), bool)
    keep[6000:6400] = False
    found = estimate_speed(time[keep], values[keep], PITCH, 0.5)
    assert found.value == pytest.approx(mean_speed(time, travel), rel=2e-4)
    assert np.isfinite(found.travel_m).all()
    assert (np.diff(found.travel_m) > 0.0).all()


def test_repeated_and_backward_stamps_are_left_out():
    rng = np.random.default_rng(0)
    time = np.arange(0.0, 60.0, 0.01)
    values = displacement(travel_of(time, 0.48), rng)
    stamps = time.copy()
    stamps[1000] = stamps[999]
    stamps[3000] -= 5.0
    found = estimate_speed(stamps, values, PITCH, 0.5)
    assert found.value == pytest.approx(0.48, rel=5e-4)
    assert len(found.travel_m) == len(time)


def test_zero_and_unit_do_not_matter():
    rng = np.random.default_rng(0)
    time = np.arange(0.0, 60.0, 0.01)
    values = displacement(travel_of(time, 0.48), rng)
    one = estimate_speed(time, values, PITCH, 0.5)
    other = estimate_speed(time + 77.0, -1e3 * values + 4.0, PITCH, 0.5)
    assert other.value == pytest.approx(one.value, rel=1e-7)


def test_second_multiple_alone_is_enough():
    rng = np.random.default_rng(0)
    time = np.arange(0.0, 60.0, 0.01)
    travel = travel_of(time, 0.48)
    values = np.cos(4 * np.pi * travel / PITCH) + 0.5 * rng.normal(size=len(time))
    found = estimate_speed(time, values, PITCH, 0.5)
    assert found.value == pytest.approx(mean_speed(time, travel), rel=1e-3)


def riding(travel, rng, n=1):
    """Return signals of sensors on the chain: any shape, the same one loop later."""
    orders = np.arange(1, 4 * N_LINKS)
    rows = []
    for _ in range(n):
        size = 1000.0 / orders + 12.0 * (orders % N_LINKS == 0)
        size *= rng.uniform(0.5, 1.5, len(orders))
        phase = rng.uniform(0, 2 * np.pi, len(orders))
        angle = 2 * np.pi * np.outer(travel / LOOP, orders) + phase
        rows.append(np.cos(angle) @ size + 10.0 * rng.normal(size=len(travel)))
    return np.column_stack(rows)


@pytest.mark.parametrize('seed', range(6))
def test_a_sensor_on_the_chain_tells_speed_by_its_loops(seed):
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 105.0, 0.02)
    travel = travel_of(time, 0.5 * (1 + rng.uniform(-0.06, 0.06)))
    found = estimate_speed(time, riding(travel, rng, 2), PITCH, 0.5, loop_m=LOOP)
    assert found.value == pytest.approx(mean_speed(time, travel), rel=5e-4)
    assert found.low <= mean_speed(time, travel) <= found.high


def test_a_sensor_on_the_chain_without_a_second_loop_says_how_little_it_knows():
    rng = np.random.default_rng(1)
    time = np.arange(0.0, 45.0, 0.02)
    travel = travel_of(time, 0.49)
    found = estimate_speed(time, riding(travel, rng, 4), PITCH, 0.5, loop_m=LOOP)
    assert found.low <= mean_speed(time, travel) <= found.high
    assert found.high - found.low > 2e-3 * found.value


@pytest.mark.parametrize('duration', [20.0, 100.0])
@pytest.mark.parametrize('red', [False, True])
def test_noise_has_no_speed(duration, red):
    for seed in range(5):
        values = np.random.default_rng(seed).normal(size=int(100 * duration))
        values = np.cumsum(values) if red else values
        time = np.arange(len(values)) / 100.0
        with pytest.raises(SynchronisationError, match='no clear pitch frequency'):
            estimate_speed(time, values, PITCH, 0.5)


def test_speed_beyond_the_stated_error_is_not_found():
    rng = np.random.default_rng(0)
    time = np.arange(0.0, 100.0, 0.01)
    with pytest.raises(SynchronisationError, match='7%'):
        estimate_speed(time, displacement(travel_of(time, 0.65), rng), PITCH, 0.5)


@pytest.mark.parametrize('n', [0, 1, 10, 300])
def test_too_short_a_recording_is_refused(n):
    time = np.arange(n) / 100.0
    with pytest.raises(SynchronisationError, match=r'expected at least 4\.9 s'):
        estimate_speed(time, np.sin(time), PITCH, 0.5)


def test_only_missing_samples_are_refused():
    time = np.arange(0.0, 60.0, 0.01)
    with pytest.raises(SynchronisationError, match='0 valid samples'):
        estimate_speed(time, np.full(len(time), np.nan), PITCH, 0.5)
    with pytest.raises(SynchronisationError, match='one value per time'):
        estimate_speed(time, time[:-1], PITCH, 0.5)


def test_constant_signal_is_refused():
    time = np.arange(0.0, 60.0, 0.01)
    with pytest.raises(SynchronisationError, match='no clear pitch'):
        estimate_speed(time, np.full(len(time), 0.01), PITCH, 0.5)


RECORDINGS = (
    'clean_1',
    'clean_2',
    'drive_ripple',
    'gauge_gain',
    'load_distribution',
    'roller_drag',
    'roller_eccentricity',
    'rolling_resistance',
    'tensioner_friction',
)


@pytest.mark.shared
@pytest.mark.parametrize('name', RECORDINGS)
def test_tensioner_and_strain_agree_on_the_speed(shared, root, name):
    machine = load_machine(root / 'config' / 'machines' / 'prototype.yaml')
    recording = read(shared / 'measured' / 'seeded' / name, machine)
    assert recording.experiment is not None
    set_speed = recording.experiment.set_speed_m_s
    tensioner = recording.signals['tensioner/displacement']
    forces = [s for c, s in recording.signals.items() if c.startswith('link_force/')]
    n = min(len(s.values) for s in forces)
    time = [1e-9 * (s.stamp_ns - s.stamp_ns[0]) for s in (tensioner, forces[0])]
    by_carriage = estimate_speed(time[0], tensioner.values, PITCH, set_speed, loop_m=LOOP)
    values = np.column_stack([s.values[:n] for s in forces])
    by_strain = estimate_speed(time[1][:n], values, PITCH, set_speed, loop_m=LOOP)
    assert by_carriage.high - by_carriage.low < 4e-4 * by_carriage.value
    # the on-board clock drifts by up to 50 ppm
    assert by_strain.value == pytest.approx(by_carriage.value, rel=3.5e-4)
    assert by_strain.low * (1 - 5e-5) <= by_carriage.value <= by_strain.high * (1 + 5e-5)
