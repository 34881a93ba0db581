"""Several recordings' normal equations, against one dense least-squares problem with all unknowns."""

from math import inf

import numpy as np
import pytest

from escalator_twin.diagnosis.normals import jackknife, Normal, solve
from escalator_twin.diagnosis.regression import fit
from escalator_twin.diagnosis.unknowns import EFFECT

pytestmark = pytest.mark.issue(7)

SIZE, SPRING, MASS = (EFFECT, '0', 'length_m'), ('tensioner.stiffness',), ('chain.mass',)
TURNED = {SPRING: 0.7, MASS: -0.4}


def preload(r: int) -> tuple[str, str]:
    return 'experiment.preload_n', str(r)


def equations(seed: int = 3, recordings: int = 3) -> list[tuple[tuple, np.ndarray, np.ndarray]]:
    """Return names, columns and residual of every recording."""
    rng = np.random.default_rng(seed)
    rows = []
    for r in range(recordings):
        names = (SIZE, SPRING, MASS, preload(r))
        rows.append((names, rng.normal(size=(40, 4)), rng.normal(size=40)))
    return rows


def normals_of(rows):
    return [Normal(names, a.T @ b, a.T @ a) for names, a, b in rows]


def dense(rows) -> dict[tuple[str, ...], float]:
    """Solve the same with one row of its own for every prior."""
    names = list(dict.fromkeys(name for row in rows for name in row[0]))
    blocks, right = [], []
    for own, columns, residual in rows:
        block = np.zeros((len(residual), len(names)))
        block[:, [names.index(name) for name in own]] = columns
        blocks.append(block)
        right.append(residual)
    for k, name in enumerate(names):
        if name != SIZE:
            prior = np.zeros((1, len(names)))
            prior[0, k] = 1.0
            blocks.append(prior)
            right.append(np.array([-TURNED.get(name, 0.0)]))
    found = np.linalg.lstsq(np.concatenate(blocks), np.concatenate(right), rcond=None)[0]
    return dict(zip(names, found, strict=True))


def squares(rows, by) -> float:
    """Return chi squared with the unknowns moved, priors included."""
    left = [b - a @ np.array([by[name] for name in names]) for names, a, b in rows]
    priors = [TURNED.get(name, 0.0) + z for name, z in by.items() if name != SIZE]
    return float(sum(np.sum(row**2) for row in left) + np.sum(np.square(priors)))


def test_one_machines_unknowns_are_those_of_the_dense_problem():
    rows = equations()
    delta, fall = solve(normals_of(rows), TURNED)
    expected = dense(rows)
    assert delta.keys() == expected.keys()
    assert delta == pytest.approx(expected)
    none = dict.fromkeys(delta, 0.0)
    assert fall == pytest.approx(squares(rows, none) - squares(rows, delta))


def test_a_recording_that_says_nothing_of_an_effect_leaves_it_to_the_others():
    """An empty recording of a load's effect: its column is none."""
    rows = equations()
    names, columns, residual = rows[2]
    rows[2] = names, columns * np.array([0.0, 1.0, 1.0, 1.0]), residual
    delta, _ = solve(normals_of(rows), TURNED)
    assert delta == pytest.approx(dense(rows))


def test_leaving_one_out_is_that_of_the_dense_problem():
    rows = equations(seed=5, recordings=4)
    moves = [dense([*rows[:r], *rows[r + 1 :]])[SIZE] for r in range(4)]
    expected = (3.0 / 4.0 * np.sum((moves - np.mean(moves)) ** 2)) ** 0.5
    assert jackknife(normals_of(rows), TURNED) == pytest.approx({SIZE: expected})


def test_what_one_recording_alone_has_seen_has_no_spread():
    rows = equations()
    rows[1:] = [(names[1:], columns[:, 1:], residual) for names, columns, residual in rows[1:]]
    assert jackknife(normals_of(rows), TURNED) == {SIZE: inf}


def test_a_fit_with_some_columns_alone_is_that_fit():
    rng = np.random.default_rng(7)
    columns = rng.normal(size=(50, 6)).astype(np.float32)
    white, offset = rng.normal(size=50).astype(np.float32), rng.normal(size=6)
    keep = np.array([0, 3, 4])
    kept, alone = (
        fit(white, columns, offset).keeping(keep),
        fit(white, columns[:, keep], offset[keep]),
    )
    assert kept.sizes == pytest.approx(alone.sizes)
    assert kept.chi2 == pytest.approx(alone.chi2)
