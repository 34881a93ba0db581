"""Scores at the machine's orders, and per loop: truth from known amplitudes and phases."""

from importlib.util import find_spec

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from tracks import make_track, slow, wave

from escalator_twin.errors import NotYetError
from escalator_twin.metrics import METRICS, order_scores, split_bands

pytestmark = pytest.mark.issue(2)


@given(ratio=st.floats(0.2, 5.0), phase=st.floats(-170.0, 170.0), order=st.sampled_from(range(6)))
@settings(max_examples=40, deadline=None)
def test_orders_give_ratio_and_phase(ratio, phase, order):
    track, _ = make_track(5.2, wander=0.002)
    k = track.orders[order]
    m = slow(track) * 0.0 + wave(track, 3.0, k, 0.4)
    s = wave(track, 3.0 * ratio, k, 0.4 + np.radians(phase))
    found = order_scores(split_bands(m, s, track))[order]
    assert found.amplitude_ratio == pytest.approx(ratio, rel=1e-3)
    assert found.phase_deg == pytest.approx(phase, abs=0.1)
    assert found.coherence == pytest.approx(1.0, abs=1e-4)
    assert found.measured == pytest.approx(3.0, rel=0.02)


def test_orders_are_not_disturbed_by_a_large_trend_or_neighbours():
    track, _ = make_track(5.2)
    pairs = [(1.0, 10.0), (2.0, 5.0), (3.0, 2.0), (4.0, 2.0), (track.orders[-1], 3.0)]
    m = slow(track) + sum(wave(track, a, k) for k, a in pairs)
    s = slow(track) + sum(wave(track, 0.5 * a, k, 0.2) for k, a in pairs)
    for found in order_scores(split_bands(m, s, track))[1:]:
        assert found.amplitude_ratio == pytest.approx(0.5, rel=0.03)
        assert found.phase_deg == pytest.approx(np.degrees(0.2), abs=2.0)


def test_coherence_of_unrelated_signals_is_low():
    track, time = make_track(20.0)
    rng = np.random.default_rng(4)
    m, s = rng.normal(size=(2, len(time)))
    for found in order_scores(split_bands(m, s, track))[1:]:
        assert found.coherence < 0.3


@pytest.mark.issue(5)
def test_iso_18571_needs_its_library():
    if find_spec('objective_rating_metrics') is not None:
        pytest.skip('objective_rating_metrics is installed')
    track, _ = make_track()
    with pytest.raises(NotYetError, match='objective_rating_metrics, which is not installed'):
        METRICS['iso_18571'](split_bands(slow(track), slow(track), track))


@pytest.mark.issue(5)
def test_iso_18571_rates_each_loop():
    pytest.importorskip('objective_rating_metrics', reason='an optional library')
    track, _ = make_track(2.3)
    s = slow(track)
    equal = METRICS['iso_18571'](split_bands(s, s + 100.0, track))
    assert equal == {part: pytest.approx(1.0) for part in equal}
    # 20 % too large: phase keeps its mark, magnitude and corridor do not
    louder = METRICS['iso_18571'](split_bands(s, 1.2 * s, track))
    assert louder['phase'] == pytest.approx(1.0)
    # dynamic time warping forgives some of it
    assert 0.5 < louder['magnitude'] < 0.95
    assert louder['corridor'] < 0.95
    short, _ = make_track(0.8)
    assert METRICS['iso_18571'](split_bands(slow(short), slow(short), short))['overall'] is None
