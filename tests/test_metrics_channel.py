"""Scores of a channel on a track: truth from signals whose every part is known."""

import json

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from scipy import signal
from tracks import LOOP, make_track, N_LINKS, PITCH, RATE, slow, SPEED, wave

from escalator_twin.errors import EscalatorError, SynchronisationError
from escalator_twin.metrics import (
    CONTRACT,
    METRICS,
    QUICK,
    score_channel,
    split_bands,
    Track,
)

pytestmark = pytest.mark.issue(2)


def is_json_safe(value):
    if isinstance(value, dict):
        return all(is_json_safe(v) for v in value.values())
    if isinstance(value, list):
        return all(is_json_safe(v) for v in value)
    return value is None or (type(value) is float and np.isfinite(value))


def test_channel_has_the_contract_keys_in_order():
    track, _ = make_track()
    scores = score_channel(slow(track), slow(track), track)
    assert tuple(scores) == CONTRACT
    keys = {'cycles_per_pitch', 'amplitude_ratio', 'phase_deg', 'coherence'}
    assert all(set(order) == keys for order in scores['orders'])
    assert [o['cycles_per_pitch'] for o in scores['orders']] == list(track.orders)
    json.dumps(scores, allow_nan=False)


@pytest.mark.parametrize('name', QUICK)
def test_every_metric_survives_every_signal(name):
    track, _ = make_track()
    n = len(track.travel_m)
    rng = np.random.default_rng(0)
    rows = (slow(track), np.zeros(n), np.full(n, np.nan), np.full(n, 1e5), rng.normal(size=n))
    for m in rows:
        for s in rows:
            assert is_json_safe(METRICS[name](split_bands(m, s, track)))


@pytest.mark.parametrize('n', [0, 1, 2, 30, 399, 400, 401, 402, 420])
def test_every_metric_survives_any_length(n):
    track, _ = make_track()
    short = Track(track.travel_m[:n], RATE, LOOP, PITCH, track.orders)
    signal_ = slow(track)[:n]
    for name in QUICK:
        assert is_json_safe(METRICS[name](split_bands(signal_, signal_, short)))


def test_standing_machine_has_no_ripple():
    standing = Track(np.zeros(2000), RATE, LOOP, PITCH)
    values = np.sin(np.arange(2000) / 50.0)
    scores = score_channel(values, values, standing)
    assert scores['r_time'] == pytest.approx(1.0)
    assert scores['ripple_r'] is None
    assert scores['ceiling_r_time'] is None
    assert is_json_safe(scores)


def test_equal_signals_score_perfectly():
    track, _ = make_track(wander=0.002)
    both = slow(track) + wave(track, 20.0, 1.0)
    scores = score_channel(both, both + 123.0, track)
    assert scores['r_time'] == pytest.approx(1.0, abs=1e-12)
    assert scores['r_freq'] == pytest.approx(1.0, abs=1e-12)
    assert scores['nrmse'] == pytest.approx(0.0, abs=1e-9)
    assert scores['lag_s'] == pytest.approx(0.0, abs=1e-4)
    assert scores['ripple_r'] == pytest.approx(1.0, abs=1e-9)
    assert scores['ripple_nrmse'] == pytest.approx(0.0, abs=1e-6)
    # only the resampling by travel is between the two passages
    assert scores['ceiling_r_time'] == pytest.approx(1.0, abs=1e-6)
    # and what the high-pass does at the ends
    assert scores['ripple_ceiling'] == pytest.approx(1.0, abs=1e-3)


def test_r_time_is_that_of_the_contract():
    track, time = make_track()
    rng = np.random.default_rng(3)
    m = slow(track) + 100.0 * rng.normal(size=len(time))
    s = slow(track) + wave(track, 200.0, 0.5)
    sections = signal.butter(4, 2.0, fs=RATE, output='sos')
    low = [signal.sosfiltfilt(sections, row) for row in (m, s)]
    start = int(np.ceil(2.0 * RATE))
    x = track.travel_m
    stop = int(np.searchsorted(x, x[start] + 2 * LOOP))
    kept = [row[start:stop] - row[start:stop].mean() for row in low]
    spectra = [np.abs(np.fft.rfft(row * np.hanning(len(row) + 1)[:-1])) for row in kept]
    bins = slice(1, int(2.0 * (stop - start) / RATE) + 1)
    scores = score_channel(m, s, track)
    assert scores['r_time'] == pytest.approx(np.corrcoef(*kept)[0, 1], abs=1e-12)
    assert scores['nrmse'] == pytest.approx((kept[0] - kept[1]).std() / kept[0].std(), abs=1e-12)
    freq = np.corrcoef(spectra[0][bins], spectra[1][bins])[0, 1]
    assert scores['r_freq'] == pytest.approx(freq, abs=1e-9)


@pytest.mark.parametrize(('n_loops', 'whole'), [(0.7, 0), (1.001, 1), (1.8, 1), (3.02, 3)])
def test_kept_are_all_whole_loops_or_all(n_loops, whole):
    track, time = make_track(n_loops, wander=0.002)
    assert track.n_loops == whole
    kept = track.kept
    assert time[kept.start] >= 2.0 > time[kept.start - 1]
    assert time[-1] - time[kept.stop - 1] >= 2.0
    if whole:
        passed = track.travel_m[kept.stop] - track.travel_m[kept.start]
        assert passed == pytest.approx(whole * LOOP, abs=SPEED / RATE)
    else:
        assert time[-1] - time[kept.stop] < 2.0


def test_antiphase_ripple_on_a_large_mean_does_not_score_well():
    track, _ = make_track()
    m = slow(track) + wave(track, 30.0, 1.0) + wave(track, 10.0, 2.0)
    s = slow(track) - wave(track, 30.0, 1.0) - wave(track, 10.0, 2.0)
    scores = score_channel(m, s, track, names=QUICK)
    assert scores['r_time'] > 0.99
    assert scores['trend_r'] > 0.9999
    assert scores['ripple_r'] == pytest.approx(-1.0, abs=1e-3)
    assert scores['ripple_nrmse'] == pytest.approx(2.0, abs=1e-2)


def test_mean_is_no_agreement():
    track, time = make_track()
    rng = np.random.default_rng(5)
    m, s = rng.normal(size=(2, len(time)))
    scores = score_channel(m + 1e5, s + 1e5, track, names=QUICK)
    assert abs(scores['r_time']) < 0.5
    assert scores['sprague_geers']['comprehensive'] > 0.2


def test_trend_and_ripple_add_up_to_the_band():
    track, _ = make_track()
    bands = split_bands(slow(track) + wave(track, 30.0, 1.0), slow(track), track)
    parts = bands.trend_kept.measured + bands.ripple_kept.measured
    np.testing.assert_allclose(parts, bands.band_kept.measured, atol=1e-9)
    ripple = bands.ripple_kept.measured
    # forwards and backwards, a cycle per pitch passes with 1 / (1 + 0.5**16)
    assert ripple.std() * np.sqrt(2.0) == pytest.approx(30.0, rel=5e-3)
    assert bands.ripple_kept.simulated.std() < 0.3


@pytest.mark.parametrize('delay', [-0.31, 0.05, 0.8])
def test_lag_is_what_is_left(delay):
    track, time = make_track()
    late = Track(SPEED * (time - delay) + 1.0, RATE, LOOP, PITCH)
    scores = score_channel(slow(late), slow(track), track)
    # the later signal is measured at earlier travel
    x0 = wave(Track(track.travel_m + 1.0, RATE, LOOP, PITCH), 1000.0, 1 / N_LINKS)
    m = wave(late, 1000.0, 1 / N_LINKS)
    assert score_channel(m, x0, track)['lag_s'] == pytest.approx(delay, abs=1e-3)
    assert scores['r_time'] < 1.0


@pytest.mark.parametrize(('share', 'known'), [(0.2, False), (0.3, True), (0.9, True), (2, True)])
def test_ceiling_needs_a_quarter_loop_twice(share, known):
    track, _ = make_track(1.0 + share)
    scores = score_channel(slow(track), slow(track), track)
    if not known:
        assert scores['ceiling_share'] is None
        assert scores['ceiling_r_time'] is None
        assert scores['ripple_ceiling'] is None
        return
    assert scores['ceiling_share'] == pytest.approx(min(share, 1.0), abs=0.01)
    assert scores['ceiling_r_time'] > 0.999


def test_ceiling_is_signal_over_signal_and_noise():
    track, time = make_track(30.0)
    rng = np.random.default_rng(2)
    clean = wave(track, 100.0, 1 / N_LINKS) + wave(track, 10.0, 1.0)
    noise = 120.0 * rng.normal(size=len(time))
    bands = split_bands(clean + noise, clean, track)
    noise_bands = split_bands(noise, clean, track)
    for name, band in (('ceiling_r_time', 'low_kept'), ('ripple_ceiling', 'ripple_kept')):
        power = getattr(bands, band).simulated.var()
        expected = power / (power + getattr(noise_bands, band).measured.var())
        assert METRICS[name](bands) == pytest.approx(expected, abs=0.03)


def test_gap_does_not_poison():
    track, time = make_track(wander=0.002)
    m = slow(track) + wave(track, 20.0, 1.0)
    s = slow(track) + wave(track, 18.0, 1.0, 0.1)
    whole = score_channel(m, s, track, names=QUICK)
    valid = (time < 8.0) | (time > 10.0)
    for filler in (np.nan, 0.0, 1e9):
        broken = np.where(valid, m, filler)
        scores = score_channel(broken, s, track, valid, QUICK)
        for name in ('r_time', 'r_freq', 'ripple_r', 'trend_r', 'r_band'):
            assert scores[name] == pytest.approx(whole[name], abs=2e-3), name
        assert scores['ripple_nrmse'] == pytest.approx(whole['ripple_nrmse'], rel=0.1)
        assert scores['lag_s'] == pytest.approx(whole['lag_s'], abs=0.01)


def test_gap_of_a_perfect_simulation_stays_perfect():
    track, time = make_track()
    both = slow(track) + wave(track, 20.0, 1.0)
    broken = np.where((time > 8.0) & (time < 12.0), np.nan, both)
    scores = score_channel(broken, both, track)
    assert scores['r_time'] == pytest.approx(1.0, abs=1e-12)
    assert scores['ripple_nrmse'] == pytest.approx(0.0, abs=1e-9)


@given(gain=st.floats(1e-6, 1e6), zeros=st.tuples(*2 * [st.floats(-3.0, 3.0)]))
@settings(max_examples=15, deadline=None)
def test_scores_ignore_unit_and_zeros(gain, zeros):
    track, time = make_track(1.4)
    rng = np.random.default_rng(1)
    m = wave(track, 1.0, 1 / N_LINKS) + 0.1 * rng.normal(size=len(time))
    s = wave(track, 1.1, 1 / N_LINKS, 0.1) + wave(track, 0.1, 1.0)
    one = score_channel(m, s, track)
    other = score_channel(gain * (m + zeros[0]), gain * (s + zeros[1]), track)
    for name in CONTRACT[:-1]:
        assert other[name] == pytest.approx(one[name], rel=1e-6, abs=1e-9), name


def test_same_samples_give_the_same_numbers():
    track, time = make_track()
    rng = np.random.default_rng(0)
    m, s = slow(track) + rng.normal(size=(2, len(time)))
    again = Track(track.travel_m.copy(), RATE, LOOP, PITCH, track.orders)
    assert score_channel(m, s, track) == score_channel(m.copy(), s.copy(), again)


@pytest.mark.parametrize(
    ('change', 'text'),
    [
        ({'rate_hz': 0.0}, 'rate_hz'),
        ({'loop_m': -1.0}, 'loop_m'),
        ({'pitch_m': np.nan}, 'pitch_m'),
        ({'travel_m': np.array([0.0, 1.0, 0.5])}, 'fall'),
        ({'travel_m': np.array([0.0, np.nan])}, 'finite'),
    ],
)
def test_track_refuses_what_is_no_track(change, text):
    good = {'travel_m': np.arange(3.0), 'rate_hz': 1.0, 'loop_m': 1.0, 'pitch_m': 1.0}
    with pytest.raises(SynchronisationError, match=text):
        Track(**{**good, **change})


def test_lengths_must_agree():
    track, _ = make_track()
    with pytest.raises(EscalatorError, match='simulated: expected'):
        score_channel(slow(track), slow(track)[:-1], track)
