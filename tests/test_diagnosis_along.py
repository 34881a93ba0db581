"""Signals along the grid, each frequency over its standard deviation."""

import numpy as np
import pytest
from scipy import fft

from escalator_twin.diagnosis.whitening import Whitener

pytestmark = pytest.mark.issue(6)
N = 400


def test_along_the_grid_what_is_weighed_alike_is_as_it_was():
    signal = np.random.default_rng(1).standard_normal((N, 2))
    mask = np.ones((N, 2))
    mask[100:200, 1] = 0.0
    found = Whitener(mask, np.full((N, 2), 0.5), 1.0).along(signal)
    assert found == pytest.approx(0.5 * mask * signal)


def test_beyond_the_bands_end_nothing_is_left():
    signal = np.random.default_rng(2).standard_normal((N, 1))
    along = Whitener(np.ones((N, 1)), np.ones((100, 1)), 1.0).along(signal)
    waves = fft.dct(along, axis=0, norm='ortho')
    assert np.abs(waves[100:]).max() < 1e-12
    assert waves[:100] == pytest.approx(fft.dct(signal, axis=0, norm='ortho')[:100])
