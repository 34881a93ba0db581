"""Place, travel and clocks are found again where they are known by construction."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import BSpline

from escalator_twin.errors import RecordingError, SynchronisationError
from escalator_twin.signals import make_signal
from escalator_twin.sync.ground import scan_shift
from escalator_twin.sync.place import find_place, fits_of, score_of
from escalator_twin.sync.template import make_template, Templates
from escalator_twin.sync.timeline import Clock, time_one, Timed
from escalator_twin.sync.travel import fit_travel, Ground, Guess, Travel

pytestmark = pytest.mark.issue(5)

PITCH = 0.405
LOOP = 24.3
SPEED = 0.47


def shape(channel, travel):
    """Return a loop's signal: a trend, local events and the pitch's ripple."""
    phase = 2.0 * np.pi * travel / LOOP
    local = 3.0 * np.exp(3.0 * (np.cos(phase - 0.7 * channel) - 1.0))
    ripple = 0.3 * np.cos(2.0 * np.pi * travel / PITCH + channel)
    return np.sin(phase + channel) + local + ripple


def wander(time):
    """Return a slow wander of travel: 0.1 % of the speed over 35 s."""
    return 0.001 * SPEED * 35.0 / (2.0 * np.pi) * np.sin(2.0 * np.pi * time / 35.0)


def recording(start=9.1, duration=80.0, noise=0.05, seed=0, channels=(0, 1, 2)):
    """Return tracks of a run whose travel is known."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, duration, 0.005)
    travel = start + SPEED * time + wander(time)
    tracks = {}
    for k in channels:
        values = shape(k, travel) + noise * rng.standard_normal(len(time))
        tracks[f'c{k}'] = Timed(f'c{k}', time, values, np.ones(len(time), bool), 200.0)
    return tracks, travel


def template_columns(channels=(0, 1, 2), end=60.0):
    """Return the same signals over travel at constant speed, as the twin gives them."""
    travel = np.arange(-2.0, end, 0.01)
    return Templates(travel, SPEED / 0.01, {f'c{k}': shape(k, travel) for k in channels})


@pytest.mark.parametrize('start', [0.0, 3.3, 12.15, 24.2])
def test_place_is_found_to_the_grid(start):
    grid = np.arange(0.0, 20.0, 0.02)
    loop = np.arange(0.0, LOOP, 0.02)
    measured = {f'c{k}': shape(k, start + grid) for k in range(3)}
    place = find_place(measured, {f'c{k}': shape(k, loop) for k in range(3)}, 0.02, PITCH)
    assert (place.start_m - start + LOOP / 2) % LOOP - LOOP / 2 == pytest.approx(0.0, abs=0.02)
    assert place.lead > 1.0


def test_one_inverted_and_one_wrong_channel_do_not_move_the_place():
    grid, loop = np.arange(0.0, 30.0, 0.02), np.arange(0.0, LOOP, 0.02)
    measured = {f'c{k}': shape(k, 5.0 + grid) for k in range(4)}
    measured['c0'] = -measured['c0']
    measured['c1'] = shape(1, 5.0 + 30 * PITCH + grid)
    place = find_place(measured, {f'c{k}': shape(k, loop) for k in range(4)}, 0.02, PITCH)
    assert place.start_m == pytest.approx(5.0, abs=0.02)


def test_a_fit_is_the_squared_correlation_and_the_slope():
    rng = np.random.default_rng(3)
    loop, measured = rng.standard_normal(50), rng.standard_normal(130)
    rows = [loop[(np.arange(130) + k) % 50] for k in range(50)]
    squared, gain = fits_of(measured, loop)
    assert squared == pytest.approx([np.corrcoef(measured, r)[0, 1] ** 2 for r in rows], abs=1e-9)
    assert gain == pytest.approx([np.polyfit(r, measured, 1)[0] for r in rows], abs=1e-9)


def test_an_odd_gain_tells_less_than_a_fair_one_and_more_than_none():
    fair, small, inverted, none = (
        float(score_of(np.array([r2]), np.array([gain]))[0])
        for r2, gain in ((0.99, 0.8), (0.99, 0.2), (0.99, -1.0), (0.0, 0.0))
    )
    assert fair == pytest.approx(-np.log(0.011))
    assert small == inverted == pytest.approx(fair - np.log(20.0))
    assert none == 0.0
    # by a little more than a factor of two the residual grows by what is missing
    (near,) = score_of(np.array([0.99]), np.array([2.2]))
    assert near == pytest.approx(-np.log(0.011 + 0.99 * (1.0 - 2.0 / 2.2) ** 2))


def test_rising_forces_are_not_taken_for_falling_ones():
    # a straight run down and one up, which the twin has a little less straight than it is
    loop = np.arange(0.0, LOOP, 0.02)
    half = len(loop) // 2
    ramp = np.abs(loop - loop[half])
    twin = ramp + np.where(loop > loop[half], 0.1 * np.sin(2.0 * np.pi * loop / PITCH), 0.0)
    start, n = half + 100, 350
    measured = {f'c{k}': ramp[start : start + n] for k in range(2)}
    place = find_place(measured, {f'c{k}': twin for k in range(2)}, 0.02, PITCH)
    assert loop[half] <= place.start_m <= LOOP - 0.02 * n


def test_place_without_a_common_channel_is_refused():
    with pytest.raises(SynchronisationError, match='no channel tells the place'):
        find_place({'a': np.zeros(5)}, {'b': np.zeros(5)}, 0.02, PITCH)


def test_travel_speed_and_wander_are_recovered():
    tracks, travel = recording()
    templates = template_columns()
    fit = fit_travel(tracks, templates, Guess(1.003 * SPEED, 9.12))
    time = tracks['c0'].time_s
    error = fit.travel.at(time) - travel
    assert np.abs(error[400:-400]).max() < 3e-3
    mean = (travel[-1] - travel[0]) / (time[-1] - time[0])
    assert fit.travel.speed_m_s == pytest.approx(mean, rel=2e-4)
    assert fit.travel.low_m_s < fit.travel.speed_m_s < fit.travel.high_m_s


def test_travel_ignores_gaps_and_outliers():
    tracks, travel = recording()
    one = tracks['c1']
    values, valid = one.values.copy(), one.valid.copy()
    values[4000:5000], valid[4000:5000] = 40.0, False
    values[7000:7040] += 25.0
    tracks['c1'] = replace(one, values=np.where(valid, values, 0.0), valid=valid)
    templates = template_columns()
    fit = fit_travel(tracks, templates, Guess(SPEED, 9.12))
    error = fit.travel.at(one.time_s) - travel
    assert np.abs(error[400:-400]).max() < 5e-3


@pytest.mark.parametrize('shift', [-0.012, 0.0, 0.03])
def test_the_grounds_clock_is_recovered(shift):
    tracks, _ = recording()
    ground = tracks['c2']
    tracks['c2'] = replace(ground, time_s=ground.time_s - shift - 40e-6 * ground.time_s)
    templates = template_columns()
    prior = Ground(shift_sd_s=0.1, rate_sd=1e-3)
    fit = fit_travel(tracks, templates, Guess(SPEED, 9.1), frozenset({'c2'}), prior)
    assert fit.ground.shift_s == pytest.approx(shift, abs=4.0 * fit.ground.shift_sd_s)
    assert fit.ground.rate == pytest.approx(40e-6, abs=4.0 * fit.ground.rate_sd)
    assert fit.ground.shift_sd_s < 0.015
    assert fit.ground.rate_sd < 3e-4


def test_a_scan_finds_the_smallest_shift_of_a_signal_that_repeats():
    time = np.arange(0.0, 60.0, 0.01)
    period = PITCH / SPEED
    late = 0.31
    values = np.cos(2.0 * np.pi * (time + late) / period)
    tracks = {'u': Timed('u', time, values, np.ones(len(time), bool), 100.0)}
    travel = np.arange(-3.0, 33.0, 0.01)
    knots = np.r_[[0.0] * 4, [60.0] * 4]
    line = Travel(SPEED, SPEED, SPEED, SPEED, BSpline(knots, np.zeros(4), 3))
    columns = {'u': np.cos(2.0 * np.pi * travel / PITCH)}
    found = scan_shift(tracks, Templates(travel, SPEED / 0.01, columns), line, 2.0)
    assert found == pytest.approx(late, abs=0.02)


def test_stamps_become_reference_time():
    stamps = 10**18 + np.arange(1000) * 5_000_000
    signal = make_signal('a/b', 'N', stamps + 600_000_000, stamps, np.arange(1000.0))
    track = time_one(signal, 200.0, 10**18, Clock(offset_s=0.6, rate=20e-6))
    expected = np.arange(1000) * 0.005 * (1.0 - 20e-6)
    assert track.time_s == pytest.approx(expected, abs=1e-9)
    assert track.valid.all()


def test_gaps_are_marked():
    stamps = 10**18 + np.r_[np.arange(100), np.arange(300, 400)] * 5_000_000
    signal = make_signal('a/b', 'N', stamps, stamps, np.ones(200))
    track = time_one(signal, 200.0, 10**18, Clock())
    assert len(track.values) == 400
    assert track.valid[:100].all()
    assert not track.valid[102:298].any()


@pytest.mark.parametrize('frequency', [2.0, 13.0])
def test_lost_samples_are_bridged_by_more_than_a_line(frequency):
    """Against closed form: in the middle of two steps a line is off by a half of (pi f / rate)**2 of a sine."""
    rate, n = 200.0, 4000
    rng = np.random.default_rng(3)
    kept = np.ones(n, bool)
    kept[1:-1] = rng.random(n - 2) > 0.1
    time = np.arange(n) / rate
    stamps = 10**18 + np.arange(n) * 5_000_000
    signal = make_signal(
        'a/b', 'N', stamps[kept], stamps[kept], np.sin(2.0 * np.pi * frequency * time[kept])
    )
    track = time_one(signal, rate, 10**18, Clock())
    off = np.abs(track.values - np.sin(2.0 * np.pi * frequency * time))
    alone = ~kept & np.roll(kept, 1) & np.roll(kept, -1) & np.roll(kept, 2) & np.roll(kept, -2)
    line = 2.0 * (np.pi * frequency / rate) ** 2
    assert alone.sum() > 200
    assert off[alone].max() < 0.05 * line
    assert off[kept].max() < 1e-12


def test_one_sample_is_refused():
    signal = make_signal('a/b', 'N', [1], [1], [1.0])
    with pytest.raises(RecordingError, match='a/b: expected samples, found 1'):
        time_one(signal, 200.0, 0, Clock())


def test_a_template_repeats_with_the_loop():
    travel = np.arange(0.0, LOOP + 0.3, 0.0025)
    place = 7.0 + travel * 24.4057 / LOOP
    template = make_template(('c',), shape(0, travel)[:, None], place, travel, LOOP)
    tiled = template.tiled(-5.0, 60.0, SPEED)
    assert tiled.columns['c'] == pytest.approx(shape(0, tiled.travel_m), abs=2e-4)
    assert template.place_at(LOOP + 1.0, 1, 24.4057) == pytest.approx(7.0 + 24.4057 / LOOP)
