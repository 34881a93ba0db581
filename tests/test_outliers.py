"""Outliers that only show beside the twin: counted and bridged where some were found without it."""

from types import SimpleNamespace

import numpy as np
import pytest

from escalator_twin.comparison.outliers import alone, bridge_left
from escalator_twin.signals import Finding
from escalator_twin.sync.timeline import Timed

pytestmark = pytest.mark.issue(6)

RATE_HZ, N = 200.0, 18_000
AT = np.array([800, 3200, 3900, 9000, 15_001])


def swinging(seed=3):
    """Return time and a force that swings by far more than the outliers in it are high."""
    time_s = np.arange(N) / RATE_HZ
    force = 4e3 * np.sin(2 * np.pi * 0.7 * time_s) + 900.0 * np.sin(2 * np.pi * 6.0 * time_s)
    return time_s, force, np.random.default_rng(seed).normal(0.0, 20.0, N)


def test_white_noise_has_none():
    found = [alone(swinging(seed)[2], RATE_HZ).sum() for seed in range(10)]
    assert sum(found) == 0


@pytest.mark.parametrize('size', [250.0, -250.0])
def test_a_sample_alone_is_found_and_a_blow_that_rings_is_not(size):
    left = swinging()[2]
    left[AT] += size
    assert (np.flatnonzero(alone(left, RATE_HZ)) == AT).all()
    blow = size * np.exp(-np.arange(12) / 3.0) * np.cos(1.3 * np.arange(12))
    left = swinging()[2]
    for k in AT:
        left[k : k + 12] += blow
    assert not alone(left, RATE_HZ).any()


@pytest.mark.parametrize('sizes', [(250.0, 420.0), (-250.0, 400.0), (250.0, -1500.0)])
def test_two_neighbours_are_found(sizes):
    left = swinging()[2]
    for k, size in enumerate(sizes):
        left[AT + k] += size
    assert (np.flatnonzero(alone(left, RATE_HZ)) == np.sort([AT, AT + 1], axis=None)).all()


@pytest.mark.parametrize('sizes', [(250.0, 250.0), (-300.0, -270.0)])
def test_a_blow_of_two_samples_is_none(sizes):
    """An empty step that rattles at 0.25 m/s: three such were counted as six outliers."""
    left = swinging()[2]
    for k, size in enumerate(sizes):
        left[AT + k] += size
    assert not alone(left, RATE_HZ).any()


def test_three_neighbours_are_something_else():
    left = swinging()[2]
    for k in range(3):
        left[AT + k] += 400.0
    assert not alone(left, RATE_HZ).any()


def test_too_short_a_signal_has_none():
    assert not alone(np.array([0.0, 9.0, 0.0]), RATE_HZ).any()


def test_what_is_left_is_bridged_in_channels_with_outliers_alone():
    time_s, force, noise = swinging()
    values = force + noise
    values[AT] += 400.0
    valid = np.ones(N, dtype=bool)
    valid[AT[0]] = False  # a gap is none
    names = ('spiky', 'other', 'unmended')
    tracks = {c: Timed(c, time_s, values, valid, RATE_HZ) for c in names}
    templates = SimpleNamespace(travel_m=time_s, columns=dict.fromkeys(names, force))
    travel = SimpleNamespace(at=lambda t: t)
    findings = [
        Finding('sensor_spikes', 'spiky', 0.0, 80.0, '16 isolated outliers, the largest', True),
        Finding('sensor_spikes', 'unmended', 0.0, 80.0, '16 isolated outliers, the largest'),
        Finding('mains_hum', 'other', 0.0, 80.0, 'a tone', True),
    ]
    mended, told = bridge_left(tracks, templates, travel, findings)
    assert [f.detail for f in told] == [
        '20 isolated outliers, the largest', findings[1].detail, 'a tone',
    ]  # fmt: skip
    assert mended['other'] is tracks['other']
    assert mended['unmended'] is tracks['unmended']
    off = mended['spiky'].values - force
    assert np.abs(off[AT[1:]]).max() < 100.0  # on a flank as on a crest
    assert off[AT[0]] > 300.0
    rest = np.setdiff1d(np.arange(N), AT)
    assert (mended['spiky'].values[rest] == values[rest]).all()


def test_what_is_left_is_bridged_where_an_exchanged_channels_signal_is():
    time_s, force, noise = swinging()
    values = force + noise
    values[AT] += 400.0
    valid = np.ones(N, dtype=bool)
    tracks = {c: Timed(c, time_s, values, valid, RATE_HZ) for c in ('own', 'other')}
    templates = SimpleNamespace(travel_m=time_s, columns=dict.fromkeys(tracks, force))
    travel = SimpleNamespace(at=lambda t: t)
    found = [Finding('sensor_spikes', 'own', 0.0, 80.0, '15 isolated outliers, the largest', True)]
    right = {'own': 'other', 'other': 'own'}
    mended, (told,) = bridge_left(tracks, templates, travel, found, right)
    assert mended['own'] is tracks['own']
    assert np.abs((mended['other'].values - force)[AT]).max() < 100.0
    assert (told.channel, told.detail) == ('own', '20 isolated outliers, the largest')
