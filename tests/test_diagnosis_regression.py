"""Least squares with priors against dense generalised least squares of the same problem.

With nuisance z of unit prior variance about zero, of which the model holds ``offset`` already, a
residual w has mean -C offset and covariance 1 + C C': everything follows from that matrix.
"""

import numpy as np
import pytest

from escalator_twin.diagnosis.regression import (
    fit,
    fit_swapped,
    inner_products,
    inverse,
    score_each,
    score_groups,
    swapped,
)

pytestmark = pytest.mark.issue(6)

SINGLE = 2e-4  # relative, of sums in single precision


class Problem:
    """A random problem and the inverse of its covariance."""

    def __init__(self, seed, m=120, q=7, k=5, offset=True):
        rng = np.random.default_rng(seed)
        scales = 10.0 ** rng.uniform(-2.0, 1.5, q)
        self.columns = (rng.normal(size=(m, q)) * scales).astype(np.float32)
        self.white = (3.0 * rng.normal(size=m)).astype(np.float32)
        self.candidates = rng.normal(size=(m, k)).astype(np.float32)
        self.offset = rng.normal(size=q) if offset else np.zeros(q)

    def dense(self, keep=None):
        """Return inverse covariance and the residual less its mean."""
        C = self.columns.astype(np.float64)
        offset = self.offset
        if keep is not None:
            C, offset = C[:, keep], offset[keep]
        covariance = np.eye(len(C)) + C @ C.T
        return np.linalg.inv(covariance), self.white + C @ offset

    def fitted(self):
        return fit(self.white, self.columns, self.offset)


@pytest.fixture(params=range(6))
def problem(request):
    return Problem(request.param, offset=request.param % 2 == 1)


def test_chi_squared(problem):
    inverse, y = problem.dense()
    assert problem.fitted().chi2 == pytest.approx(y @ inverse @ y, rel=SINGLE)


@pytest.mark.parametrize('seed', range(4))
def test_columns_that_single_precision_cannot_tell_apart(seed):
    """A Gram matrix of 1e10 whose rounding is larger than the prior: chi squared stays what it is."""
    rng = np.random.default_rng(seed)
    one = 1e4 * rng.normal(size=(400, 1))
    columns = (one + 1e-3 * rng.normal(size=(400, 8))).astype(np.float32)
    white = (3.0 * rng.normal(size=400)).astype(np.float32)
    fine = columns.astype(np.float64)
    gram = fine.T @ fine + np.eye(8)
    expected = white @ white - white @ fine @ np.linalg.solve(gram, fine.T @ white)
    other = fit(white, rng.normal(size=(400, 8)).astype(np.float32))
    for found in (
        fit(white, columns),
        swapped(other, white, list(range(8)), columns, np.zeros(8)),
    ):
        assert found.chi2 == pytest.approx(expected, rel=1e-3)
    assert fit(white, columns).without(0).chi2 == pytest.approx(expected, rel=1e-2)


def test_most_probable_nuisance(problem):
    C = problem.columns.astype(np.float64)
    inverse, y = problem.dense()
    # of the whole nuisance C' V^-1 y, less what the model holds
    expected = C.T @ inverse @ y - problem.offset
    np.testing.assert_allclose(problem.fitted().sizes, expected, atol=1e-3)
    left = problem.white - C @ expected
    np.testing.assert_allclose(problem.fitted().left(), left, atol=2e-2)


def test_no_offset_is_an_offset_of_zero():
    problem = Problem(3, offset=False)
    assert fit(problem.white, problem.columns).chi2 == problem.fitted().chi2


def test_single_candidates(problem):
    inverse, y = problem.dense()
    X = problem.candidates.astype(np.float64)
    scores = score_each(problem.fitted(), problem.candidates)
    for k in range(X.shape[1]):
        x = X[:, k]
        power = x @ inverse @ x
        size = x @ inverse @ y / power
        assert scores.sd[k] == pytest.approx(power**-0.5, rel=SINGLE)
        assert scores.size[k] == pytest.approx(size, abs=1e-3 * power**-0.5)
        fall = y @ inverse @ y - (y - size * x) @ inverse @ (y - size * x)
        assert scores.gain[k] == pytest.approx(fall, rel=1e-3, abs=1e-3)


def test_candidates_together(problem):
    inverse, y = problem.dense()
    X = problem.candidates.astype(np.float64)
    right, gram = inner_products(problem.fitted(), problem.candidates)
    np.testing.assert_allclose(right, X.T @ inverse @ y, rtol=1e-3, atol=1e-2)
    np.testing.assert_allclose(gram, X.T @ inverse @ X, rtol=1e-3, atol=1e-3)


def test_groups_of_candidates():
    problem = Problem(11, k=6)
    inverse, y = problem.dense()
    sizes, gains = score_groups(problem.fitted(), problem.candidates, 2)
    for g in range(3):
        X = problem.candidates[:, 2 * g : 2 * g + 2].astype(np.float64)
        best = np.linalg.solve(X.T @ inverse @ X, X.T @ inverse @ y)
        np.testing.assert_allclose(sizes[g], best, rtol=1e-3, atol=1e-4)
        assert gains[g] == pytest.approx(best @ X.T @ inverse @ y, rel=1e-3)


@pytest.mark.parametrize('index', [0, 3, 6])
def test_leaving_out_a_nuisance(problem, index):
    keep = np.delete(np.arange(7), index)
    inverse, y = problem.dense(keep)
    assert problem.fitted().without(index).chi2 == pytest.approx(y @ inverse @ y, rel=SINGLE)


def test_a_candidate_that_nuisance_explains_is_worth_nothing():
    # a column that may have any size leaves no information in its own direction
    problem = Problem(5, q=2)
    columns = problem.columns.copy()
    columns[:, 0] = 1e3 * problem.candidates[:, 0]
    scores = score_each(fit(problem.white, columns), problem.candidates)
    assert scores.sd[0] > 100.0 * scores.sd[1]
    assert scores.gain[0] < 1e-2


def test_coverage_of_the_standard_deviation():
    # sizes drawn with noise and nuisance are found within their standard deviations
    rng = np.random.default_rng(29)
    problem = Problem(17, offset=False)
    x = problem.candidates[:, :1]
    pulls = []
    for _ in range(300):
        nuisance = problem.columns @ rng.normal(size=problem.columns.shape[1])
        white = nuisance + 4.0 * x[:, 0] + rng.normal(size=len(nuisance))
        scores = score_each(fit(white.astype(np.float32), problem.columns), x)
        pulls.append((scores.size[0] - 4.0) / scores.sd[0])
    assert np.mean(pulls) == pytest.approx(0.0, abs=0.25)  # four of 1 / sqrt(300)
    assert np.std(pulls) == pytest.approx(1.0, abs=0.17)  # four of 1 / sqrt(600)


def test_units_of_columns_do_not_decide_what_is_null():
    """A length in metres beside an angle and a tolerance of unit prior: all three are solved for."""
    rng = np.random.default_rng(4)
    columns = rng.normal(size=(200, 3)) * np.array([3e5, 90.0, 0.3])
    gram = columns.T @ columns
    np.testing.assert_allclose(inverse(gram) @ gram, np.eye(3), atol=1e-4)
    twice = np.column_stack([columns, columns[:, 0]])
    size = inverse(twice.T @ twice) @ twice.T @ columns[:, 0]
    np.testing.assert_allclose(size, [0.5, 0.0, 0.0, 0.5], atol=1e-6)


@pytest.mark.parametrize('seed', range(4))
def test_a_fit_with_some_columns_swapped_is_the_fit_with_those_columns(seed):
    problem = Problem(seed)
    rng = np.random.default_rng(seed + 100)
    at = [5, 1]
    others = rng.normal(size=(len(problem.white), 2)).astype(np.float32)
    white = rng.normal(size=len(problem.white)).astype(np.float32)
    offset = rng.normal(size=len(problem.offset))
    columns = problem.columns.copy()
    columns[:, at] = others
    whole = fit(white, columns, offset)
    before = fit(problem.white, problem.columns, problem.offset)
    left, sizes = fit_swapped(before, white, at, others, offset)
    np.testing.assert_allclose(sizes, whole.sizes, rtol=20.0 * SINGLE, atol=20.0 * SINGLE)
    np.testing.assert_allclose(left, whole.left(), atol=20.0 * SINGLE)
    again = swapped(before, white, at, others, offset)
    assert again.chi2 == pytest.approx(whole.chi2, rel=1e-4)
    np.testing.assert_allclose(again.left(), whole.left(), atol=20.0 * SINGLE)
    np.testing.assert_allclose(
        inner_products(again, problem.candidates)[1],
        inner_products(whole, problem.candidates)[1],
        atol=20.0 * SINGLE * len(white),
    )
