"""A sensor's pose and the share of two sides: truth from known rotations and shares."""

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from escalator_twin.errors import RecordingError
from escalator_twin.metrics import remove_sensor_pose, side_scores, split_bands, Track
from escalator_twin.metrics.sides import share_of_variation

RATE = 200.0
TIME = np.arange(8000) / RATE

pytestmark = pytest.mark.issue(2)


def gravity():
    """Return the specific force (n, 3) of a step that goes round once and shakes a little."""
    angle = 0.5 * np.sin(2 * np.pi * TIME / 40.0) + np.pi * (TIME > 20.0)
    force = 9.81 * np.column_stack([np.sin(angle), 0.0 * TIME, np.cos(angle)])
    force[:, 0] += 0.2 * np.sin(2 * np.pi * 1.1 * TIME)
    force[:, 1] += 0.1 * np.sin(2 * np.pi * 0.7 * TIME)
    return force


def read(force, rotation_deg, bias, noise=0.0, seed=0):
    """Return what a turned and biased sensor reads of ``force``."""
    sensor = Rotation.from_rotvec(rotation_deg, degrees=True)
    rng = np.random.default_rng(seed)
    return sensor.inv().apply(force) + bias + noise * rng.normal(size=force.shape)


SMALL = st.floats(-5.0, 5.0)
BIAS = st.floats(-0.1, 0.1)


@given(rotation=st.tuples(SMALL, SMALL, SMALL), bias=st.tuples(BIAS, BIAS, BIAS))
@settings(max_examples=25, deadline=None)
def test_rotation_and_bias_are_recovered(rotation, bias):
    force = gravity()
    corrected, found_bias, found = remove_sensor_pose(read(force, rotation, bias), force, RATE)
    np.testing.assert_allclose(found, rotation, atol=2e-3)
    np.testing.assert_allclose(found_bias, bias, atol=2e-4)
    np.testing.assert_allclose(corrected, force, atol=1e-3)


def test_rotation_is_right_handed():
    # turned by +90 deg about x, the sensor's y axis points along the body's z
    force = np.array([0.0, 0.0, 9.81]) * np.ones((len(TIME), 1))
    assert read(force, (90.0, 0.0, 0.0), 0.0)[0] == pytest.approx([0.0, 9.81, 0.0])
    assert read(gravity(), (1.0, 0.0, 0.0), 0.0)[0, 1] > 0.0


def test_noise_leaves_hundredths_of_a_degree():
    force = gravity()
    readings = read(force, (0.3, -0.4, 0.2), (0.05, 0.0, -0.1), noise=0.02)
    _, bias, found = remove_sensor_pose(readings, force, RATE)
    np.testing.assert_allclose(found, (0.3, -0.4, 0.2), atol=0.03)
    np.testing.assert_allclose(bias, (0.05, 0.0, -0.1), atol=3e-3)


@pytest.mark.parametrize('axis', [0, 1, 2])
def test_missing_axis_does_not_matter_to_the_others(axis):
    force = gravity()
    readings = read(force, (1.0, -2.0, 1.5), (0.05, 0.02, -0.1))
    readings[:, axis] = np.nan
    corrected, bias, _ = remove_sensor_pose(readings, force, RATE)
    others = [i for i in range(3) if i != axis]
    assert np.isnan(corrected[:, axis]).all()
    assert bias[axis] == 0.0
    np.testing.assert_allclose(corrected[:, others], force[:, others], atol=5e-3)


def test_gaps_and_spikes_do_not_matter():
    force = gravity()
    readings = read(force, (1.0, -2.0, 1.5), (0.05, 0.02, -0.1))
    readings[1000:1600] = np.nan
    readings[3000, 2] = 1e6
    valid = np.ones(len(TIME), bool)
    valid[3000] = False
    _, bias, found = remove_sensor_pose(readings, force, RATE, valid)
    np.testing.assert_allclose(found, (1.0, -2.0, 1.5), atol=5e-3)
    np.testing.assert_allclose(bias, (0.05, 0.02, -0.1), atol=1e-3)


def test_nothing_to_go_by_changes_nothing():
    force = gravity()
    nothing = np.full_like(force, np.nan)
    for corrected, bias, found in (
        remove_sensor_pose(nothing, force, RATE),
        remove_sensor_pose(force, nothing, RATE),
        remove_sensor_pose(force, force, RATE, np.zeros(len(TIME), bool)),
    ):
        assert (bias == 0.0).all()
        assert (found == 0.0).all()
        assert corrected.shape == force.shape


def test_standstill_leaves_what_cannot_be_known_small():
    still = np.array([0.0, 0.0, 9.81]) * np.ones((len(TIME), 1))
    readings = still + np.array([0.05, -0.05, 0.02])
    corrected, bias, found = remove_sensor_pose(readings, still, RATE)
    np.testing.assert_allclose(corrected, still, atol=1e-3)
    assert np.abs(bias).max() < 0.1
    assert np.abs(found).max() < 1.0


def test_shape_is_checked():
    with pytest.raises(RecordingError, match=r'\(n, 3\)'):
        remove_sensor_pose(TIME, TIME, RATE)


@pytest.mark.issue(5)
@pytest.mark.parametrize('share', [0.5, 0.6, 0.4])
def test_share_is_that_of_the_varying_part(share):
    total = np.sin(TIME) + 0.3 * np.sin(3.7 * TIME)
    left, right = share * total + 5000.0, (1.0 - share) * total - 300.0
    assert share_of_variation(left, right) == pytest.approx(share)
    assert share_of_variation(left, right) + share_of_variation(right, left) == pytest.approx(1.0)


@pytest.mark.issue(5)
def test_sides_are_compared_over_the_loop():
    travel = 0.5 * TIME
    track = Track(travel, RATE, 4.0, 0.4)
    total = 500.0 * np.sin(2 * np.pi * travel / 4.0) + 100.0 * np.sin(2 * np.pi * travel / 0.8)
    # the left share changes half way round, from the first sample scored
    half = np.mod(travel - travel[track.kept.start], 4.0) < 2.0
    share = np.where(half, 0.6, 0.5)
    left = split_bands(share * total, 0.5 * total, track)
    right = split_bands((1.0 - share) * total, 0.5 * total, track)
    scores = side_scores(left, right)
    assert scores.simulated_share == pytest.approx(0.5)
    assert scores.simulated_difference == pytest.approx(0.0, abs=1e-9)
    assert scores.measured_share == pytest.approx(0.55, abs=0.01)
    assert scores.measured_by_position[2] == pytest.approx(0.6, abs=0.02)
    assert scores.measured_by_position[8] == pytest.approx(0.5, abs=0.02)
    assert len(scores.simulated_by_position) == 12
    assert scores.difference_r is None or abs(scores.difference_r) <= 1.0


@pytest.mark.issue(5)
def test_sides_without_variation_have_no_share():
    track = Track(0.5 * TIME, RATE, 4.0, 0.4)
    flat = split_bands(np.ones(len(TIME)), np.ones(len(TIME)), track)
    scores = side_scores(flat, flat)
    assert scores.measured_share is None
    assert scores.difference_nrmse is None
    assert scores.measured_by_position == (None,) * 12
