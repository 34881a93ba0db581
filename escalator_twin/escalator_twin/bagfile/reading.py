"""Read the machine's channels from a bag."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
import os
from types import SimpleNamespace

import numpy as np
from numpy.typing import NDArray

from escalator_twin.bagfile.cdr import CdrError, columns, leaves
from escalator_twin.bagfile.compression import CutError, decompress
from escalator_twin.bagfile.container import Block, Bytes, Channel, Indices, MAX_CHUNK
from escalator_twin.bagfile.definitions import Types, types_of
from escalator_twin.bagfile.source import Bag, topics_of
from escalator_twin.bagfile.tidy import tidy
from escalator_twin.conversions import experiment_of, parse_path, Path, STAMP
from escalator_twin.errors import ExperimentError, RecordingError
from escalator_twin.machine import Machine, Sensor
from escalator_twin.signals import Experiment, Finding, Floats, make_signal, Recording, Signal

CDR = 'cdr'
# A part of a channel that is not finite in more than this share of the samples counts as dead.
MAX_NOT_FINITE = 0.1


@dataclass
class _Topic:
    """One topic and the sensors on it; gathers their numbers block by block."""

    name: str
    sensors: list[Sensor]
    paths: list[Path] = field(default_factory=list)
    stamps: list[Indices] = field(default_factory=list)
    bag: list[Indices] = field(default_factory=list)
    rows: list[Floats] = field(default_factory=list)
    has_header: bool = True
    n_bad: int = 0
    problems: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        texts = dict.fromkeys(text for sensor in self.sensors for text in sensor.fields)
        self.paths = [parse_path(text) for text in texts]

    def problem(self, text: str) -> None:
        if text not in self.problems:
            self.problems.append(text)


def read(
    path: str | os.PathLike[str], machine: Machine, namespace: str | None = None
) -> Recording:
    """Read the machine's channels from a bag.

    Parameters
    ----------
    path : path
        A rosbag2 directory, or one of its files.
    machine : Machine
        Says which channel is on which topic, in which fields and units.
    namespace : str, optional
        Where the topics are; by default the machine's measured topics, or where none of these is
        in the bag, its simulated ones.

    Returns
    -------
    Recording
        The channels that are there, in SI, in the order of their stamps. What is missing or had
        to be mended is in ``findings``; `require` turns missing channels into an error.

    Raises
    ------
    BagError
        Where the container cannot be read.
    """
    with Bag(path) as bag:
        infos = topics_of(bag)
        present = {info.topic for info in infos if info.n_messages}
        chosen, findings = _choose(machine, namespace, present)
        experiment_topic = _experiment_topic(machine, chosen)
        topics = _topics(machine, chosen)
        wanted = (set(topics) | {experiment_topic}) & present
        experiment = None
        start_ns = min((info.first_ns for info in infos if info.n_messages), default=0)
        for file, block in bag.blocks(wanted):
            for index in np.unique(block.channel):
                channel = file.channels[int(index)]
                part = _select(block, int(index), bag.message_compression)
                if channel.topic == experiment_topic:
                    experiment = experiment or _experiment(channel, part, findings)
                elif channel.topic in topics:
                    _collect(topics[channel.topic], channel, part)
        signals: dict[str, Signal] = {}
        optional = {sensor.channel for sensor in machine.instruments.simulated_only}
        for topic in topics.values():
            _finish(topic, start_ns, signals, findings, optional)
        findings += _losses(bag, signals, start_ns)
    order = [s.channel for s in _sensors(machine, chosen) if s.channel in signals]
    return Recording(
        str(path), {name: signals[name] for name in order}, experiment, tuple(findings)
    )


def require(recording: Recording, channels: Iterable[str], machine: Machine) -> None:
    """Raise a RecordingError that names the missing channels and the topics they should be on."""
    missing = [name for name in channels if name not in recording.signals]
    if not missing:
        return
    instruments = machine.instruments
    topics = dict.fromkeys(
        instruments.measured_topic(instruments.sensor(name).topic) for name in missing
    )
    raise RecordingError(
        f'{recording.path}: {len(missing)} channels are missing: {", ".join(missing)}; '
        f'expected on the topics {", ".join(topics)}'
    )


# which topics


def _sensors(machine: Machine, namespace: str) -> list[Sensor]:
    instruments = machine.instruments
    sensors = list(instruments.sensors)
    if namespace == instruments.simulated_namespace:
        sensors += instruments.simulated_only
    return sensors


def _topic_name(machine: Machine, namespace: str, topic: str) -> str:
    instruments = machine.instruments
    if namespace == instruments.measured_namespace:
        return instruments.measured_topic(topic)
    return f'{namespace.rstrip("/")}/{topic.lstrip("/")}'


def _choose(
    machine: Machine, namespace: str | None, present: set[str]
) -> tuple[str, list[Finding]]:
    """Return the namespace to read."""
    instruments = machine.instruments
    measured, simulated = instruments.measured_namespace, instruments.simulated_namespace
    if namespace is not None:
        return namespace, []

    def has_any(where: str) -> bool:
        return any(_topic_name(machine, where, s.topic) in present for s in instruments.sensors)

    if has_any(measured) or not has_any(simulated):
        return measured, []
    text = f'none of the topics of {measured} is there: those of {simulated} are read instead'
    return simulated, [Finding('missing_topic', '', 0.0, 0.0, text)]


def _topics(machine: Machine, namespace: str) -> dict[str, _Topic]:
    found: dict[str, list[Sensor]] = {}
    for sensor in _sensors(machine, namespace):
        found.setdefault(_topic_name(machine, namespace, sensor.topic), []).append(sensor)
    return {name: _Topic(name, sensors) for name, sensors in found.items()}


def _experiment_topic(machine: Machine, namespace: str) -> str:
    experiment = machine.instruments.experiment
    return _topic_name(machine, namespace, experiment.topic) if experiment else ''


# messages to numbers


@dataclass(frozen=True)
class _Part:
    """The messages of one channel in a block, gathered by size: (bag time, rows)."""

    groups: tuple[tuple[Indices, Bytes], ...]


def _select(block: Block, index: int, compression: str) -> _Part:
    chosen = np.flatnonzero(block.channel == index)
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
    return _Part(tuple(groups))


def _unpack(block: Block, chosen: Indices, compression: str) -> _Part:
    """Decompress single messages, as rosbag2's compression mode MESSAGE writes them."""
    groups = []
    for i in chosen:
        raw = block.data[block.start[i] : block.start[i] + block.size[i]]
        try:
            data = decompress(raw, compression, MAX_CHUNK)
        except (CutError, KeyError):
            data = b''
        groups.append((block.bag_ns[i : i + 1], np.frombuffer(data, np.uint8)[None, :]))
    return _Part(tuple(groups))


def _types(channel: Channel) -> Types:
    return types_of(channel.type, channel.schema_encoding, channel.schema)


def _collect(topic: _Topic, channel: Channel, part: _Part) -> None:
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
        topic.n_bad += int((~is_read).sum())
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


def _experiment(channel: Channel, part: _Part, findings: list[Finding]) -> Experiment | None:
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


# numbers to signals


def _finish(
    topic: _Topic,
    start_ns: int,
    signals: dict[str, Signal],
    findings: list[Finding],
    optional: set[str],
) -> None:
    """Turn what a topic has gathered into signals and findings."""

    def note(kind: str, sensor: Sensor, span: Sequence[int], text: str, repaired: bool) -> None:
        first, last = ((t - start_ns) / 1e9 for t in span)
        findings.append(Finding(kind, sensor.channel, first, last, text, repaired))

    if not topic.rows:
        reason = topic.problems[0] if topic.problems else 'no message'
        if topic.n_bad:
            reason = f'none of its {topic.n_bad} messages fits its type'
        for sensor in topic.sensors:
            if sensor.channel not in optional:
                text = f'{topic.name}: {reason}'
                findings.append(Finding('missing_topic', sensor.channel, 0.0, 0.0, text))
        return
    bag_ns = np.concatenate(topic.bag)
    stamps = np.concatenate(topic.stamps) if topic.has_header else None
    result = tidy(stamps, bag_ns, np.concatenate(topic.rows))
    topic.stamps, topic.bag, topic.rows = [], [], []
    span = (int(bag_ns.min()), int(bag_ns.max()))
    for sensor in topic.sensors:
        for kind, text, repaired in result.remarks:
            note(kind, sensor, span, text, repaired)
        if topic.n_bad:
            note('data_gap', sensor, span, f'{topic.n_bad} messages do not fit their type', False)
        index = [topic.paths.index(parse_path(text)) for text in sensor.fields]
        parts = sensor.sign * sensor.scale * result.fields[:, index] + sensor.offset
        is_kept = np.ones(len(parts), dtype=bool)
        if not np.isfinite(parts).all():
            parts, is_kept, mended = _finite(parts)
            for kind, text in mended:
                note(kind, sensor, span, text, True)
        if not is_kept.any():
            note('missing_topic', sensor, span, f'{topic.name}: no sample is a number', False)
            continue
        signals[sensor.channel] = make_signal(
            sensor.channel,
            sensor.unit,
            result.stamp_ns[is_kept],
            result.bag_ns[is_kept],
            parts[is_kept],
        )


def _finite(parts: Floats) -> tuple[Floats, NDArray[np.bool_], list[tuple[str, str]]]:
    """Drop samples that are no numbers; a part that mostly is none is set to zero instead."""
    is_finite = np.isfinite(parts)
    share = 1.0 - is_finite.mean(axis=0)
    mended = []
    dead = share > MAX_NOT_FINITE
    if dead.any() and not dead.all():
        parts = np.where(dead, 0.0, parts)
        names = ', '.join(str(i + 1) for i in np.flatnonzero(dead))
        mended.append(('gauge_dead', f'part {names} is mostly no number: set to zero'))
        is_finite |= dead
    is_kept: NDArray[np.bool_] = np.asarray(is_finite.all(axis=1))
    n_lost = int((~is_kept).sum())
    if n_lost:
        mended.append(('data_gap', f'{n_lost} samples are no numbers: dropped'))
    return parts, is_kept, mended


def _losses(bag: Bag, signals: dict[str, Signal], start_ns: int) -> list[Finding]:
    """Return what of the container was lost as findings."""
    end_ns = max((int(s.bag_ns[-1]) for s in signals.values()), default=start_ns)
    end_s = (end_ns - start_ns) / 1e9
    return [Finding('data_gap', '', 0.0, end_s, text) for text in bag.losses]
