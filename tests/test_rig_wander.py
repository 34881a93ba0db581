"""One slow wave of a drive's speed is read from travel."""

import numpy as np
import pytest
from rig.readings_speed import one_wave

pytestmark = pytest.mark.issue(4)


@pytest.mark.parametrize('period_s', [76.9, 40.0, 110.0])
@pytest.mark.parametrize('direction', [1.0, -1.0])
def test_a_wave_of_the_speed_is_read_from_travel(period_s, direction):
    time_s = np.arange(0.0, 110.0, 0.25)
    turn = 2.0 * np.pi / period_s
    speed, amplitude = 0.49, 0.002
    # the integral of speed (1 + amplitude sin(turn t + 0.7))
    way = speed * (time_s - amplitude / turn * np.cos(turn * time_s + 0.7))
    noise = np.random.default_rng(1).normal(0.0, 1e-5, time_s.size)
    found, period, rest = one_wave(time_s, 3.0 + direction * way + noise)
    assert found == pytest.approx(amplitude, rel=0.02)
    assert period == pytest.approx(period_s, rel=0.02)
    assert rest == pytest.approx(1e-5, rel=0.1)
