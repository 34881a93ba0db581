"""Several recordings of one machine: what they say together."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

# An effect of a machine shows in every recording whose experiment excites it. One recording in ten
# may name something that it alone shows: a cause of many recordings needs more than one of them.
LEAST_SHARE = 0.3
S_SAME_M = 0.3
NORMAL_95 = 1.96


def pooled(diagnoses: Sequence[Sequence[Mapping[str, Any]]]) -> list[dict[str, Any]]:
    """Pool the effects of several recordings of one machine.

    Parameters
    ----------
    diagnoses : sequence of sequences of effects
        As contracts.md tells them, one sequence a recording.

    Returns
    -------
    effects : list of dict
        With ``recordings``: how many of them name the effect.
    """
    groups: list[list[Mapping[str, Any]]] = []
    for effects in diagnoses:
        for effect in effects:
            home = next((g for g in groups if same(g[0], effect)), None)
            if home is None:
                groups.append([effect])
            else:
                home.append(effect)
    total = len(diagnoses)
    least = 1 if total < 3 else max(2, round(LEAST_SHARE * total))
    found = [_joined(group, total) for group in groups if len(group) >= least]
    return sorted(found, key=lambda e: -e['probability'])


def same(one: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    """Tell whether two effects are one cause at one place."""
    if one['cause'] != other['cause']:
        return False
    a, b = one['location'], other['location']
    if set(a) != set(b):
        return False
    for key, value in a.items():
        if isinstance(value, float) and isinstance(b[key], float):
            if abs(value - b[key]) > S_SAME_M:
                return False
        elif key == 'steps':
            if len(set(value) ^ set(b[key])) > 2:
                return False
        elif value != b[key]:
            return False
    return True


def _joined(group: Sequence[Mapping[str, Any]], total: int) -> dict[str, Any]:
    """Return one effect from what several recordings say of it."""
    first = max(group, key=lambda e: e['probability'])
    parameters = {}
    for name in first['parameters']:
        rows = [e['parameters'][name] for e in group if name in e['parameters']]
        values = np.array([row['value'] for row in rows])
        sds = np.array([max(row['high'] - row['low'], 1e-12) for row in rows]) / (2 * NORMAL_95)
        weights = 1.0 / sds**2
        mean = float(np.sum(weights * values) / weights.sum())
        scatter = float(np.std(values)) / max(len(values) - 1, 1) ** 0.5
        sd = max(float(weights.sum() ** -0.5), scatter)
        parameters[name] = {
            'value': mean,
            'low': mean - NORMAL_95 * sd,
            'high': mean + NORMAL_95 * sd,
        }
    missing = float(np.prod([1.0 - min(e['probability'], 0.99) for e in group]))
    alternatives = [
        name for name in first['alternatives'] if all(name in e['alternatives'] for e in group)
    ]
    return {
        'cause': first['cause'],
        'location': first['location'],
        'parameters': parameters,
        'probability': float(np.clip(1.0 - missing, 0.0, 0.99)),
        'alternatives': alternatives,
        'recordings': len(group),
        'of': total,
    }
