"""Ride quality of a step: truth from published weighting factors, closed forms, geometry."""

import json
from pathlib import Path

import numpy as np
import pytest

from escalator_twin.comparison.judge import Aligned
from escalator_twin.comparison.riding import on_incline, ride_document
from escalator_twin.machine import load_machine
from escalator_twin.metrics.ride_quality import (
    COMBINED,
    HORIZONTAL,
    peaks_to_peaks,
    ride_quality,
    running_rms,
    VERTICAL,
    weighted,
    weighted_noise,
)

pytestmark = pytest.mark.issue(5)

ROOT = Path(__file__).resolve().parents[1]
RATE = 200.0
TIME = np.arange(int(100 * RATE)) / RATE
ALL = np.ones(len(TIME), bool)

# factors at the one-third-octave centres 10**(n/10) Hz
# ISO 2631-2:2003, table of Wm, 1 to 80 Hz
WM = (
    0.833, 0.907, 0.934, 0.932, 0.910, 0.872, 0.818, 0.750, 0.669, 0.582,
    0.494, 0.411, 0.337, 0.274, 0.220, 0.176, 0.140, 0.109, 0.0834, 0.0604,
)  # fmt: skip
# ISO 2631-1:1997, table 3, 0.5 to 80 Hz
WK = (
    0.418, 0.459, 0.477, 0.482, 0.484, 0.494, 0.531, 0.631, 0.804, 0.967, 1.039, 1.054,
    1.036, 0.988, 0.902, 0.768, 0.636, 0.513, 0.405, 0.314, 0.246, 0.186, 0.132,
)  # fmt: skip
# the same table, 0.5 to 8 Hz
WD = (0.853, 0.944, 0.992, 1.011, 1.008, 0.968, 0.890, 0.776, 0.642, 0.512, 0.409, 0.323, 0.253)


def sine(frequency, amplitude=1.0):
    return amplitude * np.sin(2 * np.pi * frequency * TIME)


def shake(x=0.0, y=0.0, z=0.0):
    return np.column_stack([x + 0.0 * TIME, y + 0.0 * TIME, z + 0.0 * TIME])


@pytest.mark.parametrize(
    ('weighting', 'first', 'table', 'off'),
    [(COMBINED, 0, WM, 0.004), (VERTICAL, -3, WK, 0.015), (HORIZONTAL, -3, WD, 0.01)],
)
def test_weighting_is_the_published_one(weighting, first, table, off):
    # the standard lets an instrument be off by 11 %
    frequency = 10.0 ** (np.arange(first, first + len(table)) / 10.0)
    np.testing.assert_allclose(np.abs(weighting.at(frequency)), table, rtol=off)


@pytest.mark.parametrize(('n', 'factor'), [(0, 0.833), (6, 0.818), (10, 0.494), (17, 0.109)])
def test_sine_is_weighted_by_the_published_factor(n, factor):
    ride = ride_quality(shake(y=sine(10.0 ** (n / 10), 0.3)), RATE, ALL).y
    assert ride.rms == pytest.approx(0.3 * factor / np.sqrt(2), rel=0.01)
    assert ride.a95_peak_to_peak == pytest.approx(2 * 0.3 * factor, rel=0.02)
    assert ride.duration_s == pytest.approx(100.0)
    assert ride.n_passes == 1


def test_axes_have_their_own_comfort_weighting():
    force = shake(x=sine(10**0.7), y=sine(10**0.7), z=sine(10**0.7))
    ride = ride_quality(force, RATE, ALL)
    assert ride.x.rms == ride.y.rms == ride.z.rms
    assert ride.z.comfort_rms == pytest.approx(1.039 / np.sqrt(2), rel=0.01)
    assert ride.x.comfort_rms == pytest.approx(0.409 / np.sqrt(2), rel=0.01)


@pytest.mark.parametrize('length_s', [0.5, 1.0, 4.0])
def test_running_rms_of_a_burst_is_its_closed_form(length_s):
    # a burst of length T reaches sqrt(1 - exp(-T / 1 s)) of its steady rms
    burst = sine(16.0) * (np.abs(TIME - 10.0 - length_s / 2) <= length_s / 2)
    expected = np.sqrt((1 - np.exp(-length_s)) / 2)
    assert running_rms(burst, RATE).max() == pytest.approx(expected, rel=0.005)


def test_weighted_starts_from_rest():
    # the weighted beginning does not know what comes later
    one, other = sine(3.0), np.where(TIME < 50.0, sine(3.0), 0.0)
    first = slice(0, int(49.0 * RATE))
    early = [weighted(row, RATE, COMBINED)[first] for row in (one, other)]
    np.testing.assert_allclose(*early, atol=1e-3)


def test_gravity_and_bias_say_nothing():
    quiet = ride_quality(shake(4.9, 0.1, 8.5), RATE, ALL)
    assert quiet.x.rms == pytest.approx(0.0, abs=1e-12)
    loud = ride_quality(shake(4.9, 0.1, 8.5 + sine(4.0)), RATE, ALL)
    assert loud.z.rms == pytest.approx(ride_quality(shake(z=sine(4.0)), RATE, ALL).z.rms)


def test_frame_is_turned_back_by_the_inclination():
    # a step that shakes upright on an incline of 30 degrees feels it along both own axes
    up = sine(4.0)
    ride = ride_quality(shake(x=0.5 * up, z=np.sqrt(0.75) * up), RATE, ALL, 30.0)
    assert ride.x.rms == pytest.approx(0.0, abs=1e-9)
    assert ride.z.rms == pytest.approx(0.818 / np.sqrt(2), rel=0.01)


def test_only_the_mask_counts():
    mask = (TIME > 20.0) & (TIME < 40.0) | (TIME > 60.0) & (TIME < 80.0) | (TIME > 99.0)
    force = shake(z=np.where(mask, sine(4.0), 50.0 * sine(1.3)))
    ride = ride_quality(force, RATE, mask).z
    assert ride.n_passes == 2
    assert ride.duration_s == pytest.approx(40.0, abs=0.02)
    assert ride.rms == pytest.approx(0.818 / np.sqrt(2), rel=0.02)


def test_undefined_is_none():
    short = TIME < 2.9
    assert ride_quality(shake(), RATE, short).z is None
    missing = shake(np.nan, sine(4.0), sine(4.0))
    ride = ride_quality(missing, RATE, ALL, 30.0)
    assert (ride.x, ride.z) == (None, None)
    assert ride.y.rms == pytest.approx(0.818 / np.sqrt(2), rel=0.01)
    assert ride_quality(shake(), RATE, ALL).y.a95_peak_to_peak is None
    json.dumps(ride.document(), allow_nan=False)


def test_few_missing_samples_are_bridged_many_are_not():
    force = shake(z=sine(2.0))
    force[::200, 2] = np.nan
    whole = ride_quality(shake(z=sine(2.0)), RATE, ALL).z
    assert ride_quality(force, RATE, ALL).z.rms == pytest.approx(whole.rms, rel=0.001)
    force[4000:5000, 2] = np.nan
    assert ride_quality(force, RATE, ALL).z is None


def test_peaks_of_opposite_sign_are_added():
    # the first and the last half wave are not whole
    values = np.array([1.0, 2, -3, -1, 4, -5, -2, 1])
    np.testing.assert_allclose(peaks_to_peaks(values), [3 + 4, 4 + 5])
    assert len(peaks_to_peaks(np.ones(5))) == 0


def test_noise_is_what_noise_gives():
    noise = np.random.default_rng(0).normal(scale=0.02, size=(len(TIME), 3))
    expected = weighted_noise({'y': 0.02}, RATE)['y']
    assert ride_quality(noise, RATE, ALL).y.rms == pytest.approx(expected, rel=0.05)


@pytest.fixture(scope='module')
def machine():
    return load_machine(ROOT / 'config' / 'machines' / 'prototype.yaml')


def test_incline_lies_between_the_transitions(machine):
    # landing 0.575 m and a transition of 30 degrees at either end, data sheet
    guide, place = machine.guide, np.arange(0.0, 24.4, 0.001)
    mask = on_incline(place, machine, 0)
    arcs = (guide.lower_transition_radius_m, guide.upper_transition_radius_m)
    height = guide.rise_m - sum(arcs) * (1 - np.cos(np.pi / 6))
    assert place[mask][0] == pytest.approx(0.575 + arcs[0] * np.pi / 6, abs=0.002)
    assert mask.sum() * 0.001 == pytest.approx(2 * height - machine.chain.pitch_m, abs=0.003)
    # axle 30 is there half a loop of the chain before or after axle 0
    other = place[on_incline(place, machine, 30)]
    there = (other + 30 * machine.chain.pitch_m) % 24.4057
    assert (there.min(), there.max()) == pytest.approx(
        (place[mask][0], place[mask][-1]), abs=0.003
    )


def test_document_sets_measured_beside_simulated(machine):
    place = (0.5 * TIME) % 24.4057
    rng = np.random.default_rng(1)

    def aligned(axis):
        rest = rng.normal(scale=0.02, size=len(TIME))
        row = sine(4.0, 0.1) if axis == 'y' else 0.0 * TIME
        return Aligned(row + rest, row, TIME, 0.5 * TIME, place, ALL, RATE)

    rows = {f'step/acceleration/{axis}': aligned(axis) for axis in 'xyz'}
    found = ride_document(rows, machine)
    assert set(found) == {'measured', 'simulated', 'noise', 'applies'}
    assert found['simulated']['y']['n_passes'] == 2
    assert found['simulated']['y']['rms'] == pytest.approx(0.0818 / np.sqrt(2), rel=0.03)
    assert found['simulated']['z']['rms'] == pytest.approx(0.0, abs=1e-12)
    assert found['measured']['z']['rms'] == pytest.approx(found['noise']['z'], rel=0.15)
    json.dumps(found, allow_nan=False)
    assert ride_document({}, machine) is None
