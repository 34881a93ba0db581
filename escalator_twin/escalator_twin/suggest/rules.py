"""What a field's name, its topic and the size of its numbers say about it."""

from collections.abc import Iterable
from dataclasses import dataclass
import re

import numpy as np

from escalator_twin.signals import Floats
from escalator_twin.suggest.look import Field, Topic

GRAVITY = 9.80665
MIN_MESSAGES = 10  # fewer are a setting, no signal
LARGEST = 1e100  # beyond it, no number of a sensor
EXPERIMENT = 'escalator_msgs/msg/Experiment'


@dataclass(frozen=True)
class Rule:
    """What a field's name or topic says about it.

    ``scales`` are (largest plausible root mean square or range in that unit, scale to SI, unit);
    the first that the field's numbers do not exceed is taken.
    """

    quantity: str
    instrument: str
    unit: str
    pattern: re.Pattern[str]
    scales: tuple[tuple[float, float, str], ...]
    by_range: bool = False


def _words(text: str) -> re.Pattern[str]:
    return re.compile(text, re.IGNORECASE)


RULES = (
    Rule(
        'link_force',
        'link_force',
        'N',
        _words('strain|gauge'),
        ((0.02, 7.56e7, 'm/m, times EA of the prototype'), (1e6, 75.6, 'microstrain, times EA')),
    ),
    Rule(
        'step_acceleration',
        'step',
        'm/s2',
        _words(r'accel'),
        ((3.0, GRAVITY, 'g, by its size'), (1e3, 1.0, 'm/s2')),
    ),
    Rule(
        'link_force',
        'link_force',
        'N',
        _words('force|load|tension(?!er)'),
        ((150.0, 1e3, 'kN, by its size'), (1e7, 1.0, 'N')),
    ),
    Rule(
        'carriage_displacement',
        'tensioner',
        'm',
        _words('displace|stroke|position|carriage|tensioner|laser|distance'),
        ((0.15, 1.0, 'm'), (1e4, 1e-3, 'mm, by its size')),
        by_range=True,
    ),
)
SKIPPED = _words(r'covariance|orientation|angular|header|torque|\bstamp')
GENERIC = frozenset(
    ['measured', 'link', 'strain', 'force', 'data', 'raw', 'sensor', 'wrench', 'value', 'loadcell']
)


def matches(topic: Topic) -> list[tuple[Rule, list[Field]]]:
    """Return the fields of a topic that a rule knows; each field goes to its first rule."""
    found: dict[int, list[Field]] = {}
    if topic.info.type == EXPERIMENT or topic.info.n_messages < MIN_MESSAGES:
        return []
    for item in topic.fields:
        if SKIPPED.search(item.text) or not np.isfinite(item.values).any():
            continue
        for i, rule in enumerate(RULES):
            # a field's own name says more than the topic's
            if rule.pattern.search(item.text) or (
                not any(other.pattern.search(item.text) for other in RULES)
                and rule.pattern.search(topic.info.topic)
            ):
                found.setdefault(i, []).append(item)
                break
    return [(RULES[i], fields) for i, fields in sorted(found.items())]


def scale_of(rule: Rule, values: Iterable[Floats]) -> tuple[float, str]:
    """Return the scale to SI and the unit it takes the numbers for."""
    every = [v[np.abs(v) < LARGEST] for v in values]
    if rule.by_range:
        size = max((float(np.ptp(v)) for v in every if len(v)), default=0.0)
    else:
        size = float(np.sqrt(sum(float((v**2).mean()) for v in every if len(v))))
    for limit, scale, unit in rule.scales:
        if size <= limit:
            return scale, unit
    return rule.scales[-1][1], f'unknown, numbers of {size:.3g}'
