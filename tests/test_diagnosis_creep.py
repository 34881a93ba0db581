"""A gauge's creep whose shape is not known: its size and how sure, against creep made by hand."""

import numpy as np
import pytest

from escalator_twin.diagnosis.regression import fit, score_each
from escalator_twin.diagnosis.search_gauges import CURVATURES, over_shapes

pytestmark = pytest.mark.issue(6)

N, NOISE = 400, 0.05
PART = np.linspace(0.0, 1.0, N)


def creep(c):
    return PART if c == 0.0 else (1.0 - np.exp(-c * PART)) / (1.0 - np.exp(-c))


def scores(c, seed):
    """Return what each shape makes of a creep of 1, thermal drift and a zero beside it."""
    rng = np.random.default_rng(seed)
    slow = np.stack([2.0 * PART - 1.0, np.cos(2.0 * np.pi * PART), np.sin(2.0 * np.pi * PART)], 1)
    tolerated = np.column_stack([0.1 * slow, np.full(N, 1e3)])
    signal = creep(c) + 0.1 * slow @ rng.normal(size=3) + NOISE * rng.normal(size=N)
    white, columns = signal / NOISE, tolerated / NOISE
    shapes = np.stack([creep(one) for one in CURVATURES], 1) / NOISE
    return score_each(fit(white.astype(np.float32), columns), shapes.astype(np.float32))


@pytest.mark.parametrize('c', [0.7, 2.2, 3.3])
def test_the_interval_holds_the_size_whatever_the_shape(c):
    found = np.array([over_shapes(scores(c, seed)) for seed in range(40)])
    inside = np.abs(found[:, 0] - 1.0) < 1.96 * found[:, 1]
    assert inside.mean() >= 0.85


def test_a_size_whose_shape_is_open_is_less_sure_than_that_of_the_likeliest_shape():
    score = scores(2.2, 1)
    assert over_shapes(score)[1] > 1.5 * score.sd[np.argmax(score.gain)]
