"""Look at the first messages of a topic: numeric fields, rate, clock."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from escalator_twin.bagfile.cdr import CdrError, columns, walk
from escalator_twin.bagfile.container import Bytes, Channel, Indices
from escalator_twin.bagfile.definitions import types_of
from escalator_twin.bagfile.gathering import select
from escalator_twin.bagfile.source import Bag, TopicInfo
from escalator_twin.conversions import Path, path_text, STAMP
from escalator_twin.signals import Floats

MAX_MESSAGES = 2000  # of each topic that are looked at
SAME_CLOCK_S = 0.05  # loggers whose clocks differ by less are taken for one


@dataclass
class Field:
    """One numeric field of a topic and what its numbers are like."""

    path: Path
    values: Floats

    @property
    def text(self) -> str:
        return path_text(self.path)


@dataclass
class Topic:
    """One topic, looked at."""

    info: TopicInfo
    fields: list[Field] = field(default_factory=list)
    rate_hz: float = 0.0
    ahead_s: float | None = None  # stamps minus bag time; None without a header
    problem: str = ''


def look(bag: Bag, info: TopicInfo) -> Topic:
    """Read the first messages of a topic."""
    topic = Topic(info)
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


def _take(topic: Topic, channel: Channel, bag_ns: Indices, rows: Bytes) -> None:
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
        Field(path, np.asarray(values[is_read], dtype=np.float64))
        for path, values in numbers.items()
        if path[0] != 'header'
    ]


def _round_rate(rate_hz: float) -> float:
    """Return a rate to the two digits that a setting has, to three where that is off."""
    short = float(f'{rate_hz:.2g}')
    return short if abs(rate_hz / short - 1.0) < 0.01 else float(f'{rate_hz:.3g}')


def loggers_of(topics: Sequence[Topic]) -> dict[str, str]:
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
