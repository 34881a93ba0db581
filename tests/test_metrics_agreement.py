"""Agreement of two signals: truth from closed forms and from slow plain twins."""

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from scipy import signal

from escalator_twin.metrics.agreement import (
    amplitude_spectrum,
    correlation,
    nrmse,
    products,
    spectrum_correlation,
)
from escalator_twin.metrics.filters import bridge, centred, highpass, lowpass, PIECE
from escalator_twin.metrics.lag import remaining_lag
from escalator_twin.metrics.validation import area_metric, sprague_geers, theil

RATE = 200.0
# ten whole periods of 0.5 Hz
TIME = np.arange(4000) / RATE
W = 2.0 * np.pi * 0.5

pytestmark = pytest.mark.issue(2)


def sine(amplitude=1.0, phase=0.0, w=W, time=TIME):
    return amplitude * np.sin(w * time + phase)


@pytest.mark.parametrize('phase', [0.0, 0.3, np.pi / 2, 2.5, np.pi])
def test_correlation_of_shifted_sines_is_the_cosine(phase):
    assert correlation(sine(), sine(3.0, phase)) == pytest.approx(np.cos(phase), abs=1e-12)


@pytest.mark.parametrize(('gain', 'phase'), [(1.0, 0.0), (0.5, 0.0), (1.2, 0.7), (2.0, np.pi)])
def test_nrmse_of_sines_is_the_chord(gain, phase):
    chord = abs(1.0 - gain * np.exp(1j * phase))
    assert nrmse(sine() + 7.0, sine(gain, phase) - 3.0) == pytest.approx(chord, abs=1e-12)


def test_constant_signals_have_no_score():
    constant = np.full(len(TIME), 1e4 / 3.0)
    assert correlation(constant, sine()) is None
    assert correlation(sine(), constant) is None
    assert nrmse(constant, sine()) is None
    assert nrmse(sine(), constant) == pytest.approx(1.0)
    assert spectrum_correlation(constant, sine(), RATE, 2.0) is None
    assert area_metric(constant, sine()) is None
    assert sprague_geers(products(constant, sine()))['comprehensive'] is None
    assert theil(products(constant, constant))['coefficient'] is None


def test_too_few_samples_have_no_score():
    for n in (0, 1):
        assert correlation(np.ones(n), np.ones(n)) is None
        assert nrmse(np.ones(n), np.ones(n)) is None
        assert area_metric(np.ones(n), np.ones(n)) is None
        assert spectrum_correlation(np.ones(n), np.ones(n), RATE, 2.0) is None


@given(
    gain=st.floats(0.01, 100.0),
    shift=st.floats(-1e3, 1e3),
    flip=st.sampled_from([1.0, -1.0]),
    seed=st.integers(0, 99),
)
@settings(max_examples=40, deadline=None)
def test_correlation_ignores_scale_and_zero(gain, shift, flip, seed):
    rng = np.random.default_rng(seed)
    m, s = rng.normal(size=(2, 200))
    expected = flip * correlation(m, s)
    assert correlation(m, flip * gain * s + shift) == pytest.approx(expected, abs=1e-9)


@given(gain=st.floats(0.01, 100.0), shift=st.floats(-1e3, 1e3), seed=st.integers(0, 99))
@settings(max_examples=40, deadline=None)
def test_unitless_scores_ignore_the_unit_and_both_zeros(gain, shift, seed):
    rng = np.random.default_rng(seed)
    m, s = rng.normal(size=(2, 200))
    for score in (
        nrmse,
        area_metric,
        lambda a, b: sprague_geers(products(a, b))['comprehensive'],
        lambda a, b: theil(products(a, b))['coefficient'],
        lambda a, b: spectrum_correlation(a, b, 20.0, 2.0),
    ):
        changed = score(gain * m + shift, gain * s - 2.0 * shift)
        assert changed == pytest.approx(score(m, s), rel=1e-7, abs=1e-9)


@pytest.mark.parametrize('n', [4001, 3999, 9973, 6000])
def test_spectrum_equals_the_plain_transform(n):
    rng = np.random.default_rng(n)
    values = lowpass(rng.normal(size=n), 2.0, RATE)
    spectrum = np.fft.rfft((values - values.mean()) * signal.windows.hann(n, sym=False))
    n_bins = int(2.0 * n / RATE)
    plain = np.abs(spectrum[1 : n_bins + 1]) * 4.0 / n
    fast = amplitude_spectrum(values, RATE, 2.0)
    np.testing.assert_allclose(fast, plain, atol=1e-9 * plain.max())


def test_spectrum_gives_the_amplitude_of_a_line():
    # 0.5 Hz is bin 10 of 20 s
    assert amplitude_spectrum(sine(3.0), RATE, 2.0)[9] == pytest.approx(3.0)


def test_spectra_agree_whatever_the_phase():
    assert spectrum_correlation(sine(), sine(2.0, 1.0), RATE, 2.0) == pytest.approx(1.0)
    assert abs(correlation(sine(), sine(2.0, np.pi / 2))) < 1e-12


def test_spectra_of_different_lines_do_not_agree():
    assert spectrum_correlation(sine(), sine(w=3 * W), RATE, 2.0) < 0.0


@pytest.mark.parametrize('cutoff', [0.2, 2.0, 20.0])
@pytest.mark.parametrize('n', [300, PIECE - 30, 2 * PIECE + 77])
def test_lowpass_is_sosfiltfilt(cutoff, n):
    values = np.random.default_rng(1).normal(size=n).cumsum()
    plain = signal.sosfiltfilt(signal.butter(4, cutoff, fs=RATE, output='sos'), values)
    np.testing.assert_array_equal(lowpass(values, cutoff, RATE), plain)


def test_filters_survive_any_length_and_rate():
    for n in range(20):
        assert len(lowpass(np.ones(n), 2.0, RATE)) == n
        assert len(highpass(np.ones(n), 2.0, RATE)) == n
    assert (lowpass(TIME, 2.0, 3.0) == TIME).all()
    assert (highpass(TIME, 0.0, RATE) == 0.0).all()


def test_bridge_is_straight_between_the_valid_samples():
    values = np.array([np.nan, 1.0, np.nan, np.nan, 4.0, np.nan])
    expected = [1.0, 1.0, 2.0, 3.0, 4.0, 4.0]
    np.testing.assert_allclose(bridge(values, np.isfinite(values)), expected)
    assert (bridge(values, np.zeros(6, bool)) == 0.0).all()


def test_centred_constant_is_exactly_zero():
    assert (centred(np.full(1000, 0.1)) == 0.0).all()


@pytest.mark.parametrize('delay', [-0.7, -0.0123, 0.0, 0.0042, 0.3, 1.5])
@pytest.mark.parametrize('slow', [0.02, 0.1])
def test_lag_of_a_delayed_signal(delay, slow):
    time = np.arange(12000) / RATE

    def wave(t):
        return 10.0 * np.sin(2 * np.pi * slow * t) + np.sin(2 * np.pi * 0.61 * t + 1.0)

    lag = remaining_lag(wave(time - delay), wave(time), RATE, slice(400, 11600))
    assert lag == pytest.approx(delay, abs=5e-4)


def test_lag_of_a_periodic_signal_is_the_nearest():
    time = np.arange(12000) / RATE
    period = 0.87
    noise = 1e-4 * np.random.default_rng(0).normal(size=(2, len(time)))
    m = np.sin(2 * np.pi * (time - 0.1) / period) + noise[0]
    s = np.sin(2 * np.pi * time / period) + noise[1]
    lag = remaining_lag(m, s, RATE, slice(400, 11600))
    assert lag == pytest.approx(0.1, abs=5e-4)


def test_lag_beyond_reach_or_of_a_constant_is_none():
    time = np.arange(12000) / RATE
    slow = np.sin(2 * np.pi * 0.01 * time)
    late = np.sin(2 * np.pi * 0.01 * (time - 6.0))
    kept = slice(400, 11600)
    assert remaining_lag(late, slow, RATE, kept) is None
    assert remaining_lag(slow, np.zeros(len(time)), RATE, kept) is None
    assert remaining_lag(np.zeros(len(time)), slow, RATE, kept) is None
    assert remaining_lag(slow[:900], slow[:900], RATE, slice(1, 3)) is None


def test_lag_leaves_out_what_is_not_valid():
    time = np.arange(12000) / RATE
    s = np.sin(2 * np.pi * 0.2 * time)
    m = np.sin(2 * np.pi * 0.2 * (time - 0.25))
    valid = np.ones(len(time), bool)
    valid[3000:5000] = False
    m[~valid] = s[~valid]
    kept = slice(400, 11600)
    assert remaining_lag(m, s, RATE, kept, valid) == pytest.approx(0.25, abs=1e-3)
    assert remaining_lag(m, s, RATE, kept) < 0.24


@pytest.mark.issue(5)
@pytest.mark.parametrize(('gain', 'phase'), [(1.0, 0.0), (1.3, 0.0), (0.8, 0.4), (1.0, np.pi)])
def test_sprague_geers_of_sines(gain, phase):
    scores = sprague_geers(products(sine(), sine(gain, phase)))
    # 1e-7: the arc cosine at 1 has no more digits
    assert scores['magnitude'] == pytest.approx(gain - 1.0, abs=1e-12)
    assert scores['phase'] == pytest.approx(phase / np.pi, abs=1e-7)
    assert scores['comprehensive'] == pytest.approx(np.hypot(gain - 1.0, phase / np.pi), abs=1e-7)


@pytest.mark.issue(5)
def test_theil_tells_amplitude_from_phase():
    assert theil(products(sine(), sine()))['coefficient'] == 0.0
    assert theil(products(sine(), -sine()))['coefficient'] == pytest.approx(1.0)
    louder, later = theil(products(sine(), sine(1.5))), theil(products(sine(), sine(1.0, 0.5)))
    assert louder['coefficient'] == pytest.approx(0.5 / 2.5)
    assert louder['variance'] == pytest.approx(1.0)
    assert later['coefficient'] == pytest.approx(np.sin(0.25))
    assert later['covariance'] == pytest.approx(1.0)


@pytest.mark.issue(5)
def test_area_metric_of_scaled_sines():
    # mean of |sin| is 2 / pi, the deviation of a sine 1 / sqrt(2)
    expected = 0.5 * 2.0 / np.pi * np.sqrt(2.0)
    assert area_metric(sine(), sine(1.5)) == pytest.approx(expected, rel=1e-4)
    assert area_metric(sine(), sine(1.0, 1.0)) == pytest.approx(0.0, abs=1e-2)
