"""The experiment's factors behind a set of recordings, and their main effects.

A main effect is the mean at a factor's second level less that at its first. In a full factorial
of two levels without repetition, Lenth's pseudo standard error tells effects from scatter
(R. V. Lenth, Technometrics 31(4), 1989, equations 1 to 3); elsewhere no such limit is given.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
import re

import numpy as np
from scipy.stats import t as student

from escalator_twin.report.documents import Entry, Json, number, table, text
from escalator_twin.report.numerals import direction, significant
from escalator_twin.signals import Floats

LEAST_CONTRASTS = 7  # of Lenth's method: three factors
MISSING = ''


@dataclass(frozen=True)
class Factor:
    """One setting that took two values.

    Attributes
    ----------
    name : str
    levels : (str, str)
        As printed, the lower one first.
    signs : tuple of int
        -1 or +1 for each recording; 0 where it is not known.
    """

    name: str
    levels: tuple[str, str]
    signs: tuple[int, ...]


@dataclass(frozen=True)
class Effect:
    """One factor's main effect on one quantity."""

    low: float
    high: float
    margin: float | None

    @property
    def size(self) -> float:
        """Return the mean at the second level less that at the first."""
        return self.high - self.low

    @property
    def is_clear(self) -> bool:
        """Tell whether the effect is beyond the margin of error."""
        return self.margin is not None and abs(self.size) > self.margin


def find_factors(recordings: Sequence[Entry], checks: Sequence[Entry] = ()) -> tuple[Factor, ...]:
    """Return the factors that take exactly two levels over the recordings.

    Settings are those of the documents; where load and preload are not among them, the parts of
    the cases' names tell the levels.
    """
    settings = [_settings(entry.data, checks) for entry in recordings]
    names = list(dict.fromkeys(name for row in settings for name in row))
    found = [_factor(name, [row.get(name, MISSING) for row in settings]) for name in names]
    factors = [factor for factor in found if factor is not None]
    for column in _name_parts(recordings):
        factor = _factor('', list(column))
        if factor is not None and not any(_is_alias(factor, other) for other in factors):
            factors.append(Factor(' / '.join(factor.levels), factor.levels, factor.signs))
    return tuple(factors)


def _settings(data: Json, checks: Sequence[Entry]) -> dict[str, float | str]:
    """Return what a recording's documents say of its settings."""
    checked = next((c.data for c in checks if c.data.get('path') == data.get('path')), {})
    told: dict[str, object] = {**table(checked.get('experiment')), **data}
    told |= table(data.get('experiment'))
    load = told.get('load_per_step_kg')
    if isinstance(load, list):
        known = [v for v in map(number, load) if v is not None]
        load = sum(known) / len(known) if known else None
    settings: dict[str, float | str] = {}
    for name, value in (
        ('speed (m/s)', told.get('set_speed_m_s')),
        ('direction', told.get('direction')),
        ('load (kg)', load),
        ('preload (N)', told.get('preload_n')),
    ):
        known_value = number(value)
        if known_value is not None:
            settings[name] = known_value
    return settings


def _factor(name: str, values: list[float | str]) -> Factor | None:
    levels = sorted(set(values) - {MISSING}, key=lambda v: (isinstance(v, str), v))
    if len(levels) != 2 or MISSING in values:
        return None
    if all(isinstance(level, str) for level in levels):
        levels = [values[0], next(v for v in values if v != values[0])]
    shown = [
        direction(int(v)) if name == 'direction' and isinstance(v, float) else v for v in levels
    ]
    labels = tuple(v if isinstance(v, str) else significant(v) for v in shown)
    signs = tuple(-1 if value == levels[0] else 1 for value in values)
    return Factor(name, (labels[0], labels[1]), signs)


def _name_parts(recordings: Sequence[Entry]) -> list[tuple[str, ...]]:
    """Return the parts of the cases' names, where all have as many."""
    parts = [re.split(r'[_\s]+', text(entry.data.get('case_id'))) for entry in recordings]
    if len({len(row) for row in parts}) != 1:
        return []
    return list(zip(*parts, strict=True))


def _is_alias(first: Factor, second: Factor) -> bool:
    same = sum(a == b for a, b in zip(first.signs, second.signs, strict=True))
    return same in (0, len(first.signs))


def main_effects(factors: Sequence[Factor], values: Sequence[float | None]) -> list[Effect | None]:
    """Return each factor's effect on one quantity, recordings without a value left out.

    Parameters
    ----------
    factors : sequence of Factor
        Their signs are in the order of ``values``.
    values : sequence of float or None
        One for each recording.
    """
    known = [i for i, value in enumerate(values) if value is not None]
    y = np.array([values[i] for i in known], dtype=np.float64)
    signs = np.array([[f.signs[i] for i in known] for f in factors]).reshape(len(factors), -1)
    margin = lenth_margin(signs, y)
    effects: list[Effect | None] = []
    for row in signs:
        if not ((row < 0).any() and (row > 0).any()):
            effects.append(None)
            continue
        effects.append(Effect(float(y[row < 0].mean()), float(y[row > 0].mean()), margin))
    return effects


def lenth_margin(signs: np.ndarray, values: Floats) -> float | None:
    """Return Lenth's margin of error at 95 %; ``None`` where the plan is no full factorial.

    Parameters
    ----------
    signs : (n_factors, n) int
        -1 or +1.
    values : (n,) float64
        Of any unit; the margin's is the same.
    """
    n_factors, n = signs.shape
    if n != 2**n_factors or n - 1 < LEAST_CONTRASTS or len({tuple(c) for c in signs.T}) != n:
        return None
    contrasts = np.array(
        [
            abs(values @ np.prod(signs[list(chosen)], axis=0)) * 2.0 / n
            for size in range(1, n_factors + 1)
            for chosen in combinations(range(n_factors), size)
        ]
    )
    first = 1.5 * float(np.median(contrasts))
    pseudo = 1.5 * float(np.median(contrasts[contrasts <= 2.5 * first]))
    return float(student.ppf(0.975, len(contrasts) / 3.0)) * pseudo


def means(values: Mapping[str, float | None]) -> tuple[float, float, float, int] | None:
    """Return mean, least and largest of what is known, and how many that are."""
    known = [v for v in values.values() if v is not None]
    if not known:
        return None
    return sum(known) / len(known), min(known), max(known), len(known)
