"""Tuning does not end where all gauges together would have to be wrong."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import norm

from escalator_twin.diagnosis import preparation

pytestmark = pytest.mark.issue(6)

FOUR = ('left_a', 'left_b', 'right_a', 'right_b')


@pytest.mark.parametrize(
    ('gains', 'other', 'again', 'kept'),
    [
        ((-4.3, -4.9, -4.7, -5.4), 900.0, True, 'held'),
        ((-4.3, -4.9, -4.7, -5.4), 1100.0, True, 'free'),  # no better without
        ((2.2, 2.4, 0.1, 2.1), 900.0, True, 'held'),
        ((0.3, 30.0, -0.8, 0.2), 900.0, False, 'free'),  # one gauge's own
        ((30.0, 28.0), 900.0, False, 'free'),  # two tell nothing of all
    ],
)
def test_the_machine_is_tuned_once_more_where_all_gauges_together_read_wrong(
    monkeypatch, gains, other, again, kept
):
    runs = []

    def tuned(context, jobs, start, held=()):
        runs.append(held)
        assert (context, jobs, start) == ('context', 2, 'start')
        name = 'held' if held else 'free'
        return name, SimpleNamespace(name=name, chi2=other if held else 1000.0)

    monkeypatch.setattr(preparation, 'tuned', tuned)
    monkeypatch.setattr(preparation, 'beside', lambda *_, start, **__: start)
    monkeypatch.setattr(preparation, 'quiet_chi2', lambda place: place.chi2)
    found = dict(zip(FOUR, gains, strict=False))
    monkeypatch.setattr(preparation, 'gains_of', lambda _: found)
    context, place = preparation._tuned('context', 'start', 2)
    assert (context, place.name) == (kept, kept)
    assert runs == ([(), FOUR] if again else [()])


def test_good_gauges_seldom_read_wrong_together():
    """The median of four is the mean of the middle two; its chance, counted."""
    medians = np.median(np.random.default_rng(2).standard_normal((10**6, 4)), axis=1)
    beyond = float(np.mean(np.abs(medians) > preparation.TOGETHER))
    assert beyond < 1.0 / 1000.0 < 2.0 * norm.sf(preparation.TOGETHER)
