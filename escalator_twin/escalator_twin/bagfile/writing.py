"""Write a rosbag2 directory: one MCAP file with zstd chunks, and its metadata.yaml."""

from collections.abc import Iterable, Iterator, Mapping
import heapq
import os
from pathlib import Path as FilePath
import shutil
import tempfile
from typing import NamedTuple

import numpy as np
from rosbags.interfaces import Connection
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer, WriterError
from rosbags.typesys import get_types_from_msg, get_typestore, Stores, TypesysError
from rosbags.typesys.store import Typestore

from escalator_twin.bagfile.cdr import CdrError, walk
from escalator_twin.bagfile.container import Bytes, Indices
from escalator_twin.bagfile.definitions import Types, typestore_for
from escalator_twin.bagfile.encoding import encode
from escalator_twin.bagfile.ordering import Message
from escalator_twin.conversions import experiment_values, parse_path, Path, STAMP
from escalator_twin.errors import BagError
from escalator_twin.machine import Machine, Sensor
from escalator_twin.signals import Floats, Recording, Signal

MAX_STAMP_NS = (1 << 31) * 1_000_000_000  # builtin_interfaces/Time: int32 seconds
# Fields that say "not measured" (REP 145) where a type holds more than its sensor gives.
ABSENT: Mapping[str, Mapping[str, float]] = {
    'sensor_msgs/msg/Imu': {
        'orientation.w': 1.0,
        'orientation_covariance[0]': -1.0,
        'angular_velocity_covariance[0]': -1.0,
    },
    'escalator_msgs/msg/RollerForce': {'s': float('nan')},
}


class _Stream(NamedTuple):
    """All messages of one topic, in the order of bag time: (n, size) bytes."""

    topic: str
    type: str
    bag_ns: Indices
    rows: Bytes


def check_target(path: str | os.PathLike[str]) -> FilePath:
    """Return where a bag can be written; raise a BagError where something is there already."""
    target = FilePath(path)
    try:
        if target.exists() and not (target.is_dir() and not any(target.iterdir())):
            raise BagError(f'{target}: exists already and is not empty; nothing is overwritten')
    except OSError as error:
        raise BagError(f'{target}: {error.strerror or error}') from error
    return target


def write(
    path: str | os.PathLike[str],
    recording: Recording | Iterable[Message],
    machine: Machine | None = None,
    namespace: str = '/simulated',
    definitions: Mapping[str, str] | None = None,
) -> None:
    """Write a bag.

    Parameters
    ----------
    path : path
        The directory to make; an empty one may be there.
    recording : Recording or iterable of Message
        Channels, turned into the messages that ``machine`` says; or messages as they are.
    machine : Machine
        Needed for a Recording.
    namespace : str
        Where the topics of a Recording go.
    definitions : mapping, optional
        Type -> ros2msg text, of messages whose type is neither installed nor known here.

    Raises
    ------
    BagError
        Where something is there already or cannot be written. Then, and when interrupted,
        nothing is left behind.
    """
    target = check_target(path)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        # rosbags names the file after its directory: so that has its last name from the start
        folder = FilePath(tempfile.mkdtemp(prefix=f'.{target.name}.', dir=target.parent))
    except OSError as error:
        raise BagError(f'{target}: cannot be made: {error.strerror or error}') from error
    try:
        made = folder / target.name
        if isinstance(recording, Recording):
            if machine is None:
                raise TypeError('a Recording is written by its machine')
            _write_streams(made, _streams(recording, machine, namespace))
        else:
            _write_messages(made, recording, definitions or {})
        if target.exists():
            target.rmdir()
        made.rename(target)
    except (OSError, WriterError, TypesysError, CdrError) as error:
        raise BagError(f'{target}: cannot be written: {error}') from error
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _writer(path: FilePath) -> Writer:
    writer = Writer(path, version=9, storage_plugin=StoragePlugin.MCAP)
    writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    return writer


def _write_streams(path: FilePath, streams: list[_Stream]) -> None:
    store = typestore_for({stream.type for stream in streams})
    with _writer(path) as writer:
        connections = [
            writer.add_connection(stream.topic, stream.type, typestore=store) for stream in streams
        ]
        order = heapq.merge(*(_numbered(i, stream) for i, stream in enumerate(streams)))
        for bag_ns, i, row in order:
            writer.write(connections[i], bag_ns, streams[i].rows[row].tobytes())


def _numbered(i: int, stream: _Stream) -> Iterator[tuple[int, int, int]]:
    """Yield (bag time, number of the topic, row)."""
    return ((t, i, row) for row, t in enumerate(stream.bag_ns.tolist()))


def _write_messages(
    path: FilePath, messages: Iterable[Message], definitions: Mapping[str, str]
) -> None:
    connections: dict[tuple[str, str], Connection] = {}
    with _writer(path) as writer:
        for message in messages:
            key = (message.topic, message.type)
            if key not in connections:
                store = _store(message, definitions.get(message.type, ''))
                connections[key] = writer.add_connection(*key, typestore=store)
            writer.write(connections[key], message.bag_ns, message.data)


def _store(message: Message, definition: str) -> Typestore:
    """Return a typestore that knows a message's type, by ``definition`` where there is one."""
    if definition:
        types = get_types_from_msg(definition, message.type)
        common = get_typestore(Stores.ROS2_JAZZY).fielddefs
        store = get_typestore(Stores.EMPTY)
        store.register({**{k: v for k, v in common.items() if k not in types}, **types})
        return store
    store = typestore_for({message.type})
    if message.type not in store.fielddefs:
        raise BagError(f'{message.topic}: no definition of the type {message.type!r}')
    return store


# numbers to messages


def _streams(recording: Recording, machine: Machine, namespace: str) -> list[_Stream]:
    """Turn a recording into messages, topic by topic."""
    instruments = machine.instruments
    groups: dict[tuple[str, str], list[Sensor]] = {}
    for sensor in instruments.sensors + instruments.simulated_only:
        if sensor.channel in recording.signals:
            groups.setdefault((sensor.topic, sensor.type), []).append(sensor)
    kinds = {kind for _, kind in groups}
    if instruments.experiment:
        kinds.add(instruments.experiment.type)
    types: Types = typestore_for(kinds).fielddefs
    streams = []
    experiment = instruments.experiment
    if experiment and recording.experiment:
        first = min(
            (int(s.bag_ns[0]) for s in recording.signals.values() if len(s.bag_ns)), default=0
        )
        stamp = dict(zip(STAMP, divmod(first, 1_000_000_000), strict=True))
        raw = encode(experiment.type, types, {**experiment_values(recording.experiment), **stamp})
        rows = np.frombuffer(raw, np.uint8)[None, :]
        name = _name(namespace, experiment.topic)
        streams.append(_Stream(name, experiment.type, np.array([first]), rows))
    for (topic, kind), sensors in groups.items():
        signals = [recording.signals[sensor.channel] for sensor in sensors]
        streams.append(_stream(_name(namespace, topic), kind, sensors, signals, types))
    return streams


def _name(namespace: str, topic: str) -> str:
    return f'{namespace.rstrip("/")}/{topic.lstrip("/")}'


def _stream(
    topic: str, kind: str, sensors: list[Sensor], signals: list[Signal], types: Types
) -> _Stream:
    """Build the messages of one topic: one for each stamp of any of its sensors."""
    if kind not in types:
        raise BagError(f'{topic}: no definition of the type {kind!r}')
    stamps = signals[0].stamp_ns
    bag_ns = signals[0].bag_ns
    if any(not np.array_equal(stamps, signal.stamp_ns) for signal in signals[1:]):
        every = np.concatenate([signal.stamp_ns for signal in signals])
        stamps, first = np.unique(every, return_index=True)
        bag_ns = np.concatenate([signal.bag_ns for signal in signals])[first]
    if len(stamps) and not 0 <= int(stamps.min()) <= int(stamps.max()) < MAX_STAMP_NS:
        raise BagError(f'{topic}: stamps from {stamps.min()} ns do not fit a header')
    if len(bag_ns) and int(bag_ns.min()) < 0:
        raise BagError(f'{topic}: a bag time of {bag_ns.min()} ns is before 1970')
    values: dict[Path, Floats] = {}
    labels: dict[Path, float | int | str] = {
        parse_path(text): value for text, value in ABSENT.get(kind, {}).items()
    }
    for sensor, signal in zip(sensors, signals, strict=True):
        labels |= {parse_path(text): _label(value) for text, value in sensor.labels.items()}
        raw = _fields(sensor, signal)
        where = np.searchsorted(stamps, signal.stamp_ns)
        for k, text in enumerate(sensor.fields):
            column = np.full(len(stamps), np.nan)
            column[where] = raw[:, k]
            values[parse_path(text)] = column
    rows = _rows(kind, types, labels, values, stamps)
    order = np.argsort(bag_ns, kind='stable')
    return _Stream(topic, kind, bag_ns[order], rows[order])


def _label(value: object) -> float | int | str:
    return value if isinstance(value, int | float | str) else str(value)


def _fields(sensor: Sensor, signal: Signal) -> Floats:
    """Return what the message's fields hold: the inverse of the reading, (n, k)."""
    parts = signal.parts
    if parts.shape[1] == 1:
        parts = np.repeat(parts, len(sensor.fields), axis=1)
    if parts.shape[1] != len(sensor.fields):
        raise BagError(
            f'{sensor.channel}: expected {len(sensor.fields)} parts, found {parts.shape[1]}'
        )
    return (parts - sensor.offset) / (sensor.sign * sensor.scale)


def _rows(
    kind: str,
    types: Types,
    labels: dict[Path, float | int | str],
    values: dict[Path, Floats],
    stamps: Indices,
) -> Bytes:
    """Build messages of one layout: a first one by its definition, the rest by columns."""
    template: dict[Path, float | int | str] = {**labels, **dict.fromkeys(values, 0)}
    raw = encode(kind, types, template)
    layout = walk(raw, kind, types, {*values, *STAMP})
    rows = np.tile(np.frombuffer(raw, np.uint8), (len(stamps), 1))
    columns = dict(values)
    if STAMP[0] in layout.places:
        seconds, nanoseconds = np.divmod(stamps, 1_000_000_000)
        columns |= {STAMP[0]: seconds, STAMP[1]: nanoseconds}
    for path, column in columns.items():
        place = layout.places[path]
        if place.dtype.kind in 'iu':
            column = np.rint(np.nan_to_num(column))
        cells = np.ascontiguousarray(column.astype(place.dtype)[:, None]).view(np.uint8)
        rows[:, place.offset : place.offset + place.dtype.itemsize] = cells
    return rows
