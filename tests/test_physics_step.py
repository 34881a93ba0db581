"""The implicit step and what it looks up, against dense algebra and closed forms."""

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from escalator_twin.diagnosis.observation import slope_along, spline_at
from escalator_twin.physics.chain import CORNER, FORCED, NEXT, PIVOT, solve_cyclic
from escalator_twin.physics.rails import cubics, rail_at
from escalator_twin.physics.run import middle_of

pytestmark = pytest.mark.issue(6)
LOOP_M = 24.0


def dense(diagonal, coupled):
    """Return the cyclic matrix whose row i is coupled to row i + 1."""
    n = len(diagonal)
    matrix = np.diag(diagonal)
    for i in range(n):
        matrix[i, (i + 1) % n] += coupled[i]
        matrix[(i + 1) % n, i] += coupled[i]
    return matrix


@pytest.mark.parametrize(('sides', 'links', 'forced'), [(1, 60, 3), (2, 60, 2), (2, 5, 2)])
def test_the_links_system_is_solved_as_a_dense_one(sides, links, forced):
    rng = np.random.default_rng(links + sides)
    work = np.zeros((7, sides, links))
    work[PIVOT] = rng.uniform(0.15, 0.4, (sides, links))
    work[NEXT] = rng.uniform(-0.07, 0.07, (sides, links))
    work[FORCED : FORCED + forced] = rng.normal(size=(forced, sides, links))
    given = work.copy()
    work[CORNER] = 0.0
    solve_cyclic(work)
    for side in range(sides):
        matrix = dense(given[PIVOT, side], given[NEXT, side])
        wanted = np.linalg.solve(matrix, given[FORCED : FORCED + forced, side].T).T
        assert work[FORCED : FORCED + forced, side] == pytest.approx(wanted, rel=1e-10, abs=1e-12)


def test_a_rail_is_hermites_cubic_round_the_loop():
    rng = np.random.default_rng(3)
    table = rng.normal(size=(1, 40, 2)) * [1e-3, 1e-2]
    at = np.arange(41) * LOOP_M / 40
    ends = np.concatenate([table[0], table[0, :1]])
    wanted = CubicHermiteSpline(at, ends[:, 0], ends[:, 1])
    rails = cubics(table, LOOP_M)
    per_m = 40 / LOOP_M
    for s in rng.uniform(0.0, LOOP_M, 50):
        value, slope = rail_at(rails, 0, s * per_m, per_m)
        assert value == pytest.approx(float(wanted(s)), abs=1e-15)
        assert slope == pytest.approx(float(wanted(s, 1)), abs=1e-13)
        # one loop on, and one back
        assert rail_at(rails, 0, (s + LOOP_M) * per_m, per_m)[0] == pytest.approx(value, abs=1e-14)
        assert rail_at(rails, 0, (s - LOOP_M) * per_m, per_m)[0] == pytest.approx(value, abs=1e-14)


def wave(t):
    """Return two waves of 10 and 25 samples a period, and their slopes per sample."""
    turns = 2.0 * np.pi / np.array([10.0, 25.0])
    phase = t[:, None] * turns + [0.3, 1.1]
    return np.sin(phase), np.cos(phase) * turns


def test_a_run_is_put_between_its_samples():
    values, _ = wave(np.arange(400.0))
    where = np.random.default_rng(5).uniform(0.0, 399.0, 300)
    wanted, _ = wave(where)
    inside = (where > 12) & (where < 387)
    # a cubic spline is off by (2 pi / 10)^4 / 384 in the middle between ten samples a period, once over
    assert np.abs(spline_at(values, where) - wanted)[inside].max() < 2.0 * (0.2 * np.pi) ** 4 / 384
    assert spline_at(values, np.arange(400.0)) == pytest.approx(values, abs=1e-12)
    # beside an end its slope may be any: by less than a tenth of the wave
    assert np.abs(spline_at(values, where) - wanted).max() < 0.1


def test_a_slope_is_that_of_the_wave():
    spacing_m = 0.01
    values, slopes = wave(np.arange(400.0))
    found = slope_along(values, spacing_m)
    assert found.shape == values.shape
    inside = slice(12, -12)
    # a spline's slope on its samples is of fourth order: (2 pi / 10)^4 / 180 of the wave's
    bound = 1.1 * (0.2 * np.pi) ** 4 / 180 * 0.2 * np.pi / spacing_m
    assert np.abs(found - slopes / spacing_m)[inside].max() < bound


@pytest.mark.parametrize('first', [-0.01, 0.0, 3.0, 19.99, 20.01])
@pytest.mark.parametrize('apart', [-0.03, -0.005, 0.0, 0.005, 0.03])
def test_between_two_places_of_a_loop_is_the_one_half_way_on_the_short_way(first, apart):
    length = 20.0
    # each may be told a loop further, or before the loop's beginning
    middle = first + 0.5 * apart
    for other in (first + apart, (first + apart) % length):
        found = middle_of(first, other, length)
        assert 0.0 <= found < length
        assert np.exp(2j * np.pi * found / length) == pytest.approx(
            np.exp(2j * np.pi * middle / length), abs=1e-12
        )
