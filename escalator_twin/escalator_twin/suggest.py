"""Draft the instruments section of a machine description for a foreign recording.

The draft names every numeric field: those whose quantity can be guessed as sensors, the rest as
comments. It is for a person to edit: sides, links and units are guesses.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
import os
import re

import numpy as np

from escalator_twin.bagfile.cdr import CdrError, columns, walk
from escalator_twin.bagfile.container import Bytes, Channel
from escalator_twin.bagfile.definitions import types_of
from escalator_twin.bagfile.gathering import select
from escalator_twin.bagfile.source import Bag, TopicInfo, topics_of
from escalator_twin.conversions import Path, path_text, STAMP
from escalator_twin.signals import Floats

GRAVITY = 9.80665
MIN_MESSAGES = 10
MAX_MESSAGES = 2000  # of each topic that are looked at
LARGEST = 1e100  # beyond it, no number of a sensor
SAME_CLOCK_S = 0.05  # loggers whose clocks differ by less are taken for one
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


@dataclass
class _Field:
    """One numeric field of a topic and what its numbers are like."""

    path: Path
    values: Floats

    @property
    def text(self) -> str:
        return path_text(self.path)


@dataclass
class _Topic:
    """One topic, looked at."""

    info: TopicInfo
    fields: list[_Field] = field(default_factory=list)
    rate_hz: float = 0.0
    ahead_s: float | None = None  # stamps minus bag time; None without a header
    problem: str = ''


def suggest(path: str | os.PathLike[str]) -> str:
    """Return a draft of the instruments section, as YAML.

    Raises
    ------
    BagError
        Where the container cannot be read.
    """
    with Bag(path) as bag:
        topics = [_look(bag, info) for info in topics_of(bag) if info.n_messages]
    loggers = _loggers(topics)
    sensors: list[str] = []
    unknown: list[str] = []
    names: set[str] = set()
    for topic in topics:
        rest = list(topic.fields)
        for rule, fields in _matches(topic):
            sensors += _sensors(topic, rule, fields, loggers[topic.info.topic], names)
            rest = [item for item in rest if item not in fields]
        unknown += _comments(topic, rest)
    return '\n'.join(
        [
            *_head(topics, loggers),
            '  sensors:' if sensors else '  sensors: []',
            *sensors,
            *unknown,
            '',
        ]
    )


# looking at a topic


def _look(bag: Bag, info: TopicInfo) -> _Topic:
    """Read the first messages of a topic."""
    topic = _Topic(info)
    for file, block in bag.blocks({info.topic}):
        for index in np.unique(block.channel):
            channel = file.channels[int(index)]
            if channel.topic != info.topic:
                continue
            if channel.serialization != 'cdr':
                topic.problem = f'encoding {channel.serialization!r} is not read'
                return topic
            for bag_ns, rows in select(block, int(index), bag.message_compression).groups:
                _take(topic, channel, bag_ns[:MAX_MESSAGES], rows[:MAX_MESSAGES])
                return topic
    return topic


def _take(topic: _Topic, channel: Channel, bag_ns: np.ndarray, rows: Bytes) -> None:
    """Take all numbers of some messages of one size."""
    types = types_of(channel.type, channel.schema_encoding, channel.schema)
    try:
        layout = walk(rows[0].tobytes(), channel.type, types)
    except CdrError as error:
        topic.problem = str(error)
        return
    paths = list(layout.places)
    found, is_read = columns(rows, channel.type, types, paths)
    numbers = dict(zip(paths, found, strict=True))
    times = bag_ns[is_read]
    if all(path in numbers for path in STAMP):
        stamps = numbers[STAMP[0]] * 1_000_000_000 + numbers[STAMP[1]]
        stamps = stamps[is_read].astype(np.int64)
        topic.ahead_s = float(np.median(stamps - times)) / 1e9
        times = stamps
    if len(times) > 1 and (step := float(np.median(np.diff(np.sort(times))))) > 0.0:
        topic.rate_hz = _round_rate(1e9 / step)
    topic.fields = [
        _Field(path, np.asarray(values[is_read], dtype=np.float64))
        for path, values in numbers.items()
        if path[0] != 'header'
    ]


def _round_rate(rate_hz: float) -> float:
    """Return a rate to the two digits that a setting has, to three where that is off."""
    short = float(f'{rate_hz:.2g}')
    return short if abs(rate_hz / short - 1.0) < 0.01 else float(f'{rate_hz:.3g}')


def _loggers(topics: Sequence[_Topic]) -> dict[str, str]:
    """Return topic -> logger: topics whose stamps are equally far from the bag time share one."""
    known: list[float] = []
    result = {}
    for topic in topics:
        ahead = 0.0 if topic.ahead_s is None else topic.ahead_s
        near = [i for i, other in enumerate(known) if abs(other - ahead) < SAME_CLOCK_S]
        if abs(ahead) < SAME_CLOCK_S:
            result[topic.info.topic] = 'ground'
            continue
        if not near:
            known.append(ahead)
            near = [len(known) - 1]
        result[topic.info.topic] = 'on_board' if near[0] == 0 else f'logger_{near[0] + 1}'
    return result


# guessing


def _matches(topic: _Topic) -> list[tuple[Rule, list[_Field]]]:
    """Return the fields of a topic that a rule knows; each field goes to its first rule."""
    found: dict[int, list[_Field]] = {}
    if topic.info.type == EXPERIMENT or topic.info.n_messages < MIN_MESSAGES:
        return []  # a setting, no signal
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


def _scale(rule: Rule, values: Iterable[Floats]) -> tuple[float, str]:
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


def _sensors(
    topic: _Topic, rule: Rule, fields: list[_Field], logger: str, names: set[str]
) -> list[str]:
    """Return the YAML of the sensors on one topic."""
    scale, unit = _scale(rule, [item.values for item in fields])
    groups: list[tuple[str, list[_Field]]]
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


def _motion(item: _Field) -> float:
    return float(np.nanstd(item.values))


def _sensor(
    topic: _Topic,
    rule: Rule,
    name: str,
    members: list[_Field],
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


def _at(rule: Rule, topic: str, members: list[_Field]) -> str:
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


# text


def _head(topics: Sequence[_Topic], loggers: dict[str, str]) -> list[str]:
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


def _comments(topic: _Topic, rest: list[_Field]) -> list[str]:
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
