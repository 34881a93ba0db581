"""The normal equations of several recordings with unknowns in common."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import inf

import numpy as np

from escalator_twin.diagnosis.regression import inverse
from escalator_twin.diagnosis.unknowns import EFFECT, Name
from escalator_twin.signals import Floats


@dataclass(frozen=True)
class Normal:
    """What one recording says of the unknowns, to first order, beside all that is its own.

    Attributes
    ----------
    names : tuple of Name
        Of its unknowns.
    right : (k,) float64
    gram : (k, k) float64
        Of the normal equations, without priors.
    """

    names: tuple[Name, ...]
    right: Floats
    gram: Floats


def solve(
    normals: Sequence[Normal], turned: Mapping[Name, float]
) -> tuple[dict[Name, float], float]:
    """Solve all recordings' normal equations at once, each tolerance with its prior.

    Parameters
    ----------
    normals : sequence of Normal
    turned : mapping of name to float
        Where the tolerances are, standard deviations.

    Returns
    -------
    delta : mapping of name to float
        By how much every unknown is to be moved; of an effect's, the variable in which it is about linear.
    fall : float
        Of chi squared by that, to second order.
    """
    names = list(dict.fromkeys(name for normal in normals for name in normal.names))
    index = {name: k for k, name in enumerate(names)}
    right, gram = np.zeros(len(names)), np.zeros((len(names), len(names)))
    for normal in normals:
        at = [index[name] for name in normal.names]
        right[at] += normal.right
        gram[np.ix_(at, at)] += normal.gram
    for name, k in index.items():
        if name[0] != EFFECT:
            right[k] -= turned.get(name, 0.0)
            gram[k, k] += 1.0
    delta = inverse(gram) @ right
    return dict(zip(names, delta.tolist(), strict=True)), float(right @ delta)


def jackknife(normals: Sequence[Normal], turned: Mapping[Name, float]) -> dict[Name, float]:
    """Return by how much every effect's number moves as each recording is left out, one standard deviation.

    To first order: the normal equations of the others (Efron and Stein, Ann. Stat. 9, 1981). Parameters are
    those of `solve`. Infinite where one recording alone says something of it.
    """
    n = len(normals)
    moves = [solve([*normals[:r], *normals[r + 1 :]], turned)[0] for r in range(n)]
    found = {}
    for name in dict.fromkeys(name for normal in normals for name in normal.names):
        if name[0] != EFFECT:
            continue
        if not all(name in move for move in moves):
            found[name] = inf
            continue
        ways = np.array([move[name] for move in moves])
        found[name] = float(((n - 1) / n * np.sum((ways - ways.mean()) ** 2)) ** 0.5)
    return found
