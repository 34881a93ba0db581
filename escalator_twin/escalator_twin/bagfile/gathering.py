"""Take the numbers of the machine's topics out of blocks of messages."""

from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np

from escalator_twin.bagfile.cdr import CdrError, columns, leaves
from escalator_twin.bagfile.compression import CutError, decompress
from escalator_twin.bagfile.container import (
    ALWAYS,
    Block,
    Bytes,
    Channel,
    Indices,
    MAX_CHUNK,
    Span,
)
from escalator_twin.bagfile.definitions import Types, types_of
from escalator_twin.conversions import experiment_of, parse_path, Path, STAMP
from escalator_twin.errors import ExperimentError
from escalator_twin.machine import Sensor
from escalator_twin.signals import Experiment, Finding, Floats

CDR = 'cdr'


@dataclass
class Topic:
    """One topic and the sensors on it; gathers their numbers block by block.

    What is wrong is counted inside ``span`` only.
    """

    name: str
    sensors: list[Sensor]
    paths: list[Path] = field(default_factory=list)
    stamps: list[Indices] = field(default_factory=list)
    bag: list[Indices] = field(default_factory=list)
    rows: list[Floats] = field(default_factory=list)
    has_header: bool = True
    n_bad: int = 0
    problems: list[str] = field(default_factory=list)
    span: Span = ALWAYS

    def __post_init__(self) -> None:
        texts = dict.fromkeys(text for sensor in self.sensors for text in sensor.fields)
        self.paths = [parse_path(text) for text in texts]

    def problem(self, text: str) -> None:
        if text not in self.problems:
            self.problems.append(text)


@dataclass(frozen=True)
class Part:
    """The messages of one channel in a block, gathered by size: (bag time, rows)."""

    groups: tuple[tuple[Indices, Bytes], ...]


def select(block: Block, index: int, compression: str, span: Span = ALWAYS) -> Part:
    """Return the messages of one channel of a block whose bag time lies in ``span``."""
    chosen = np.flatnonzero((block.channel == index) & span.holds(block.bag_ns))
    if compression:
        return _unpack(block, chosen, compression)
    data = np.frombuffer(block.data, np.uint8)
    groups = []
    for size in np.unique(block.size[chosen]):
        if not 4 <= size <= len(data):
            rows = chosen[block.size[chosen] == size]
            groups.append((block.bag_ns[rows], np.zeros((len(rows), 0), np.uint8)))
            continue
        rows = chosen[block.size[chosen] == size]
        windows = np.lib.stride_tricks.sliding_window_view(data, int(size))
        groups.append((block.bag_ns[rows], windows[block.start[rows]]))
    return Part(tuple(groups))


def _unpack(block: Block, chosen: Indices, compression: str) -> Part:
    """Decompress single messages, as rosbag2's compression mode MESSAGE writes them."""
    groups = []
    for i in chosen:
        raw = block.data[block.start[i] : block.start[i] + block.size[i]]
        try:
            data = decompress(raw, compression, MAX_CHUNK)
        except (CutError, KeyError):
            data = b''
        groups.append((block.bag_ns[i : i + 1], np.frombuffer(data, np.uint8)[None, :]))
    return Part(tuple(groups))


def _types(channel: Channel) -> Types:
    return types_of(channel.type, channel.schema_encoding, channel.schema)


def collect(topic: Topic, channel: Channel, part: Part) -> None:
    """Take a topic's numbers out of one block."""
    if channel.serialization != CDR:
        topic.problem(f'encoding {channel.serialization!r} is not read, only {CDR!r}')
        return
    types = _types(channel)
    if channel.type not in types:
        topic.problem(f'no definition of the type {channel.type!r}')
        return
    names = [name for name, _ in types[channel.type][1]]
    header = _has_header(types, channel.type)
    absent = [path for path in topic.paths if path[0] not in names]
    if absent:
        topic.problem(f'the type {channel.type} has no field {absent[0][0]!r}')
        return
    topic.has_header &= header
    paths = [*(STAMP if header else ()), *topic.paths]
    for bag_ns, rows in part.groups:
        found, is_read = columns(rows, channel.type, types, paths)
        topic.n_bad += int((~is_read & topic.span.holds(bag_ns)).sum())
        if not is_read.any():
            continue
        stamps = (
            found[0].astype(np.int64) * 1_000_000_000 + found[1].astype(np.int64)
            if header
            else bag_ns
        )
        topic.stamps.append(stamps[is_read])
        topic.bag.append(bag_ns[is_read])
        values = np.column_stack(found[2:] if header else found).astype(np.float64)
        topic.rows.append(values[is_read])


def _has_header(types: Types, name: str) -> bool:
    for field_name, (kind, detail) in types[name][1]:
        if field_name == 'header' and kind.name == 'NAME' and detail == 'std_msgs/msg/Header':
            return True
    return False


def read_experiment(channel: Channel, part: Part, findings: list[Finding]) -> Experiment | None:
    """Read the first experiment message of a block that says something."""
    for _, rows in part.groups:
        for row in rows:
            try:
                values = leaves(row.tobytes(), channel.type, _types(channel))
                flat = {str(path[0]): value for path, value in values.items() if len(path) == 1}
                return experiment_of(SimpleNamespace(**flat))
            except (CdrError, KeyError, ExperimentError) as error:
                text = f'{channel.topic}: the experiment cannot be read: {error}'
                finding = Finding('missing_topic', '', 0.0, 0.0, text)
                if finding not in findings:
                    findings.append(finding)
    return None
