"""The draft's YAML."""

from collections.abc import Sequence
import re

import numpy as np

from escalator_twin.signals import Floats
from escalator_twin.suggest.look import Field, Topic
from escalator_twin.suggest.rules import EXPERIMENT, GENERIC, Rule, scale_of, SKIPPED


def sensors_of(
    topic: Topic, rule: Rule, fields: list[Field], logger: str, names: set[str]
) -> list[str]:
    """Return the YAML of the sensors on one topic."""
    scale, unit = scale_of(rule, [item.values for item in fields])
    groups: list[tuple[str, list[Field]]]
    if rule.quantity == 'step_acceleration':
        groups = [(f'acceleration/{item.path[-1]!s}', [item]) for item in fields]
    elif all(isinstance(item.path[-1], int) for item in fields):
        groups = [(_name(topic.info.topic), fields)]  # gauges of one link: their mean
    else:
        groups = [(_name(topic.info.topic), [max(fields, key=_motion)])]
    lines = []
    for name, members in groups:
        base, n = name, 2
        while f'{rule.instrument}/{name}' in names:
            name, n = f'{base}_{n}', n + 1
        names.add(f'{rule.instrument}/{name}')
        lines += _sensor(topic, rule, name, members, (scale, unit), logger)
        lines += [
            f'      # also there: {item.text}'
            for item in fields
            if len(groups) == 1 and item not in members
        ]
    return lines


def _motion(item: Field) -> float:
    return float(np.nanstd(item.values))


def _sensor(
    topic: Topic,
    rule: Rule,
    name: str,
    members: list[Field],
    scale: tuple[float, str],
    logger: str,
) -> list[str]:
    texts = ', '.join(f"'{item.text}'" for item in members)
    noise = float(np.median([_noise(item.values) for item in members]))
    return [
        f'    - instrument: {rule.instrument}',
        f'      name: {name}',
        f'      quantity: {rule.quantity}',
        f'      at: {_at(rule, topic.info.topic, members)}',
        f'      unit: {rule.unit}',
        f'      topic: {topic.info.topic}',
        f'      type: {topic.info.type}',
        f'      fields: [{texts}]',
        f'      scale: {scale[0]:#.6g}  # recorded in {scale[1]}: check',
        '      sign: 1',
        f'      logger: {logger}',
        f'      rate_hz: {topic.rate_hz or 1.0}',
        f'      noise: {noise:.2e}  # of one field, by its second differences',
    ]


def _noise(values: Floats) -> float:
    if len(values) < 5:
        return 0.0
    return float(1.4826 * np.nanmedian(np.abs(np.diff(values, 2))) / np.sqrt(6.0))


def _at(rule: Rule, topic: str, members: list[Field]) -> str:
    side = 'right' if 'right' in topic.lower() else 'left'
    if rule.quantity == 'step_acceleration':
        return f'{{step: 0, axis: {members[0].path[-1]}}}  # which step: edit'
    if rule.quantity == 'link_force':
        return f'{{link: 0, side: {side}}}  # which link: edit'
    return '{}'


def _name(topic: str) -> str:
    """Return a channel's name out of its topic: what is not generic, else the last word."""
    parts = [re.sub(r'\W+', '_', part) for part in topic.strip('/').split('/')]
    telling = [part for part in parts if part.lower() not in GENERIC]
    return telling[-1] if telling else parts[-1]


def head_of(topics: Sequence[Topic], loggers: dict[str, str]) -> list[str]:
    names = sorted(set(loggers.values()) | {'ground'})
    lines = ['# A draft: check units, signs, sides and places.', 'instruments:', '  loggers:']
    for name in names:
        limits = (0.0, 0.0) if name == 'ground' else (2.0, 50.0)
        lines.append(f'    {name}: {{offset_s: {limits[0]}, drift_ppm: {limits[1]}}}')
    lines.append('  recorder: {latency_s: 0.005}')
    for topic in topics:
        if topic.info.type == EXPERIMENT:
            lines.append(f'  experiment: {{topic: {topic.info.topic}, type: {EXPERIMENT}}}')
    return lines


def comments_on(topic: Topic, rest: list[Field]) -> list[str]:
    """Return what is on a topic and was not taken, as comments."""
    if topic.info.type == EXPERIMENT:
        return []
    lines = []
    if topic.problem or not topic.fields:
        reason = topic.problem or 'no numbers'
        lines.append(f'    # {topic.info.topic} ({topic.info.type}): {reason}')
    for item in rest:
        if SKIPPED.search(item.text):
            continue
        known = item.values[np.isfinite(item.values)]
        span = f'{known.min():.4g} to {known.max():.4g}' if len(known) else 'no numbers'
        lines.append(
            f'    # {topic.info.topic} ({topic.info.type}) {item.text}: '
            f'{span} at {topic.rate_hz:g} Hz'
        )
    return lines
