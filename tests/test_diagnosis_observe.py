"""A recording on the grid along travel: where its rows are, and what it takes over of the comparison."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy import fft
import trials

from escalator_twin.diagnosis.grids import Frame
from escalator_twin.diagnosis.observation import observe

pytestmark = pytest.mark.issue(6)

MACHINE = trials.prototype()
CHANNELS = tuple(s.channel for s in MACHINE.instruments.sensors)
SPEED = 0.5
FRAME = Frame.of(MACHINE, SPEED)
RATE = 200.0
START_M = 3.21


def observed(duration_s, pose=None):
    """Return a recording of a slow wave of travel on the grid."""
    time_s = np.arange(0.0, duration_s, 1.0 / RATE)
    travel = SPEED * time_s + 2e-3 * np.sin(0.2 * time_s)
    track = SimpleNamespace(
        time_s=time_s,
        values=np.sin(2.0 * np.pi * travel),
        rate_hz=RATE,
        valid=np.ones(time_s.size, bool),
    )
    aligned = SimpleNamespace(time_s=time_s, travel_m=travel)
    setting = SimpleNamespace(tracks=dict.fromkeys(CHANNELS, track))
    judgement = SimpleNamespace(channels=dict.fromkeys(CHANNELS, aligned), pose=pose or {})
    return observe(setting, judgement, MACHINE, FRAME, START_M)


def test_the_comparisons_rotation_is_taken_over():
    found = observed(30.0, {'rotation_deg': (2.96, -1.13, 0.5)})
    assert np.rad2deg(found.rotation_rad) == pytest.approx((2.96, -1.13, 0.5))
    assert observed(30.0).rotation_rad == (0.0, 0.0, 0.0)


@pytest.mark.parametrize('duration_s', [30.0, 47.3, 110.01, 160.4])
def test_the_grid_is_of_a_length_that_transforms_are_quick_at(duration_s):
    found = observed(duration_s)
    n = len(found.index)
    assert n == fft.next_fast_len(n)
    # and little of the recording is left out: a second at both ends, and what the length takes
    whole = (duration_s - 2.0) * FRAME.rate_hz
    assert 0.97 * whole - 2 < n <= whole + 1


def test_rows_are_where_the_travel_says():
    found = observed(30.0)
    wave = np.sin(2.0 * np.pi * found.travel_m)
    # the filter's own ends reach a second further
    inner = slice(100, -100)
    assert found.measured[inner, 0] == pytest.approx(wave[inner], abs=2e-4)
    passed = found.time_s[:, 0]
    assert found.travel_m == pytest.approx(SPEED * passed + 2e-3 * np.sin(0.2 * passed), abs=1e-6)
    assert found.index[0] * FRAME.spacing_m == pytest.approx(found.travel_m[0] + START_M)
    assert found.valid.all()
