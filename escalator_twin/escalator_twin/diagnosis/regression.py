"""Generalised least squares with priors: how much better one more column explains a signal."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from escalator_twin.signals import Floats

NULL = 1e-9  # of a Gram matrix's largest eigenvalue, its columns of unit length


@dataclass(frozen=True)
class Fitted:
    """A residual fitted with nuisance columns of unit prior variance.

    Attributes
    ----------
    white : (m,) float32
        The residual, whitened.
    columns : (m, q) float32
        Whitened.
    gram : (q, q) float64
        ``columns.T @ columns``.
    factor : (q, q) float64
        Lower Cholesky factor of the normal matrix with the prior.
    projected : (q,) float64
        ``columns.T @ white``, less what earlier turns of the nuisance took.
    """

    white: np.ndarray
    columns: np.ndarray
    gram: Floats
    factor: Floats
    projected: Floats
    offset: Floats

    @property
    def sizes(self) -> Floats:
        """Most probable sizes of the nuisance, standard deviations, (q,)."""
        found: Floats = linalg.cho_solve((self.factor, True), self.projected)
        return found

    @property
    def chi2(self) -> float:
        """Squared residual plus squared nuisance at the optimum."""
        total = float(np.dot(self.white.astype(np.float64), self.white.astype(np.float64)))
        return total + float(self.offset @ self.offset) - float(self.projected @ self.sizes)

    def without(self, index: int) -> 'Fitted':
        """Return the fit without one nuisance column; what the model holds of it stays there."""
        return self.keeping(np.delete(np.arange(len(self.offset)), index))

    def keeping(self, keep: np.ndarray) -> 'Fitted':
        """Return the fit with some of the nuisance columns alone; what the model holds of others stays."""
        columns = self.columns[:, keep]
        gram, factor = _factored(self.gram[np.ix_(keep, keep)], lambda: columns)
        return Fitted(self.white, columns, gram, factor, self.projected[keep], self.offset[keep])

    def left(self) -> np.ndarray:
        """Return the whitened residual with the nuisance taken out, (m,)."""
        rest: np.ndarray = self.white - self.columns @ self.sizes.astype(np.float32)
        return rest


def _factored(gram: Floats, columns: Callable[[], np.ndarray]) -> tuple[Floats, Floats]:
    """Return a Gram matrix and the lower Cholesky factor of it with the prior, (q, q) each.

    Columns of some 1e4 standard deviations that are nearly alike, as those of a carriage that has come to
    its stop, leave the prior's one less than single precision rounds: then the products are made anew
    in double precision.
    """
    try:
        return gram, linalg.cholesky(gram + np.eye(len(gram)), lower=True)
    except linalg.LinAlgError:
        fine = columns().astype(np.float64)
        gram = fine.T @ fine
        return gram, linalg.cholesky(gram + np.eye(len(gram)), lower=True)


def fit(white: np.ndarray, columns: np.ndarray, offset: Floats | None = None) -> Fitted:
    """Fit a whitened residual with whitened nuisance columns.

    Parameters
    ----------
    white : (m,) float32
    columns : (m, q) float32
    offset : (q,) float64, optional
        Sizes of the nuisance that the model behind the residual holds already.
    """
    start = np.zeros(columns.shape[1]) if offset is None else offset
    gram, factor = _factored((columns.T @ columns).astype(np.float64), lambda: columns)
    projected = (columns.T @ white).astype(np.float64) - start
    return Fitted(white, columns, gram, factor, projected, start)


def fit_swapped(
    before: Fitted, white: np.ndarray, at: Sequence[int], others: np.ndarray, offset: Floats
) -> tuple[np.ndarray, Floats]:
    """Fit a residual with the columns of an earlier fit, but for some that are others now.

    The products of those that stay are known, and are most of what a fit costs.

    Parameters
    ----------
    before : Fitted
    white : (m,) float32
        The residual.
    at : sequence of int
        Which columns are swapped.
    others : (m, k) float32
        For what, whitened.
    offset : (q,) float64
        Sizes of the nuisance that the model behind the residual holds already.

    Returns
    -------
    left : (m,) float32
        The residual with the nuisance taken out.
    sizes : (q,) float64
        Of the nuisance, beyond ``offset``.
    """
    _, factor, projected = _swapped_products(before, white, at, others, offset)
    sizes: Floats = linalg.cho_solve((factor, True), projected)
    kept = sizes.astype(np.float32)
    kept[at] = 0.0
    left = white - before.columns @ kept - others @ sizes[at].astype(np.float32)
    return left, sizes


def swapped(
    before: Fitted, white: np.ndarray, at: Sequence[int], others: np.ndarray, offset: Floats
) -> Fitted:
    """Return the fit itself, with its columns; parameters are those of `fit_swapped`."""
    products = _swapped_products(before, white, at, others, offset)
    return Fitted(white, _swapped_columns(before, at, others), *products, offset)


def _swapped_columns(before: Fitted, at: Sequence[int], others: np.ndarray) -> np.ndarray:
    columns = before.columns.copy()
    columns[:, at] = others
    return columns


def _swapped_products(
    before: Fitted, white: np.ndarray, at: Sequence[int], others: np.ndarray, offset: Floats
) -> tuple[Floats, Floats, Floats]:
    """Return Gram matrix, factor and right side of a fit with some columns swapped."""
    gram = before.gram.copy()
    gram[:, at] = before.columns.T @ others
    gram[at, :] = gram[:, at].T
    gram[np.ix_(at, at)] = others.T @ others
    projected = (before.columns.T @ white).astype(np.float64)
    projected[at] = others.T @ white
    gram, factor = _factored(gram, lambda: _swapped_columns(before, at, others))
    return gram, factor, projected - offset


@dataclass(frozen=True)
class Scores:
    """What each candidate column alone would explain beside the nuisance.

    Attributes
    ----------
    size, sd : (k,) float64
        Estimate and standard deviation.
    gain : (k,) float64
        By how much chi squared falls.
    """

    size: Floats
    sd: Floats
    gain: Floats


def inner_products(fitted: Fitted, candidates: np.ndarray) -> tuple[Floats, Floats]:
    """Return right side (k,) and Gram matrix (k, k) of candidates beside the nuisance."""
    cross = (fitted.columns.T @ candidates).astype(np.float64)
    half = linalg.solve_triangular(fitted.factor, cross, lower=True)
    start = linalg.solve_triangular(fitted.factor, fitted.projected, lower=True)
    right = (candidates.T @ fitted.white).astype(np.float64) - half.T @ start
    gram = (candidates.T @ candidates).astype(np.float64) - half.T @ half
    return right, gram


def inverse(gram: Floats) -> Floats:
    """Return the pseudo-inverse of a Gram matrix (k, k), whatever the units of its columns.

    A column per metre is some 1e5 times one per radian: what counts as null is told of the
    columns' directions, not of their lengths.
    """
    length = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    scale = np.outer(length, length)
    found: Floats = np.linalg.pinv(gram / scale, rcond=NULL, hermitian=True) / scale
    return found


def score_each(fitted: Fitted, candidates: np.ndarray) -> Scores:
    """Score candidate columns (m, k) one by one."""
    cross = (fitted.columns.T @ candidates).astype(np.float64)
    half = linalg.solve_triangular(fitted.factor, cross, lower=True)
    start = linalg.solve_triangular(fitted.factor, fitted.projected, lower=True)
    right = (candidates.T @ fitted.white).astype(np.float64) - half.T @ start
    power = np.einsum('ij,ij->j', candidates, candidates, dtype=np.float64)
    power = np.maximum(power - np.einsum('ij,ij->j', half, half), 1e-12)
    return Scores(right / power, 1.0 / np.sqrt(power), right**2 / power)


def score_groups(fitted: Fitted, candidates: np.ndarray, width: int) -> tuple[Floats, Floats]:
    """Score groups of ``width`` neighbouring columns; sizes (g, width) and gains (g,)."""
    groups = candidates.shape[1] // width
    sizes, gains = np.empty((groups, width)), np.empty(groups)
    cross = (fitted.columns.T @ candidates).astype(np.float64)
    half = linalg.solve_triangular(fitted.factor, cross, lower=True)
    start = linalg.solve_triangular(fitted.factor, fitted.projected, lower=True)
    right = (candidates.T @ fitted.white).astype(np.float64) - half.T @ start
    for g in range(groups):
        part = slice(g * width, (g + 1) * width)
        block = candidates[:, part]
        gram = (block.T @ block).astype(np.float64) - half[:, part].T @ half[:, part]
        gram += 1e-9 * np.trace(gram) * np.eye(width)
        sizes[g] = np.linalg.solve(gram, right[part])
        gains[g] = right[part] @ sizes[g]
    return sizes, gains
