"""Recordings and bags made for tests, by other libraries than the ones that are tested."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
import io
from pathlib import Path
from typing import Any, NamedTuple

from mcap.writer import CompressionType, Writer
import numpy as np
from rosbags.typesys import get_types_from_msg, get_typestore, Stores

from escalator_twin.machine import load_machine, Machine
from escalator_twin.signals import Experiment, make_signal, Recording, Signal

ROOT = Path(__file__).resolve().parents[1]
PROTOTYPE = ROOT / 'config' / 'machines' / 'prototype.yaml'
START_NS = 1_790_000_000_000_000_000

STRAIN = 'std_msgs/Header header\nstring link\nfloat64[4] strain\n'
DISPLACEMENT = 'std_msgs/Header header\nfloat64 displacement\n'
EXPERIMENT = (
    'std_msgs/Header header\nstring machine\nstring case_id\nfloat64 set_speed\n'
    'int8 direction\nfloat64 load_per_step\nfloat64 preload\nstring notes\n'
)
OWN = {
    'escalator_msgs/msg/LinkStrain': STRAIN,
    'escalator_msgs/msg/TensionerDisplacement': DISPLACEMENT,
    'escalator_msgs/msg/Experiment': EXPERIMENT,
}


def prototype() -> Machine:
    return load_machine(PROTOTYPE)


def typestore(extra: dict[str, str] | None = None) -> Any:
    """Return rosbags' store with this project's types: the independent serialiser."""
    store = get_typestore(Stores.ROS2_JAZZY)
    for name, text in {**OWN, **(extra or {})}.items():
        store.register(get_types_from_msg(text, name))
    return store


STORE = typestore()


def message(kind: str, store: Any = STORE, **values: Any) -> Any:
    """Build a message with zeros where nothing is given; nested fields are ``a__b=...``."""
    made = _default(store, kind)
    for name, value in values.items():
        *above, last = name.split('__')
        owner = made
        for part in above:
            owner = getattr(owner, part)
        setattr(owner, last, value)
    return made


def _default(store: Any, kind: str) -> Any:
    fields = {}
    for name, (node, detail) in store.fielddefs[kind][1]:
        fields[name] = _default_value(store, node.name, detail)
    return store.types[kind](**fields)


def _default_value(store: Any, node: str, detail: Any) -> Any:
    if node == 'NAME':
        return _default(store, detail)
    if node == 'BASE':
        return {'string': '', 'bool': False, 'float32': 0.0, 'float64': 0.0}.get(detail[0], 0)
    (element, inner), n = detail
    n = n if node == 'ARRAY' else 0
    if element.name == 'BASE' and inner[0] != 'string':
        return np.zeros(n, dtype=inner[0].replace('byte', 'uint8').replace('char', 'uint8'))
    return [_default_value(store, element.name, inner) for _ in range(n)]


def stamp(message: Any, time_ns: int) -> Any:
    message.header.stamp.sec, message.header.stamp.nanosec = divmod(time_ns, 1_000_000_000)
    return message


class Raw(NamedTuple):
    """One message for `write_mcap`."""

    topic: str
    type: str
    bag_ns: int
    data: bytes


def raw(topic: str, kind: str, bag_ns: int, made: Any, store: Any = STORE, **options: Any) -> Raw:
    return Raw(topic, kind, bag_ns, bytes(store.serialize_cdr(made, kind, **options)))


def strain_messages(
    n: int, topic: str = '/measured/link/left_a/strain', **changes: Any
) -> list[Raw]:
    """Return strain messages at 200 Hz whose gauges read k, k + 1, k + 2, k + 3 microstrain."""
    rows = []
    for k in range(n):
        time = START_NS + 5_000_000 * k
        made = message(
            'escalator_msgs/msg/LinkStrain',
            link='left_a',
            strain=1e-6 * np.arange(k, k + 4, dtype=np.float64),
            **changes,
        )
        rows.append(
            raw(topic, 'escalator_msgs/msg/LinkStrain', time + 4_000_000, stamp(made, time))
        )
    return rows


def definition(kind: str, store: Any = STORE) -> str:
    return str(store.generate_msgdef(kind, ros_version=2)[0])


def mcap_bytes(
    messages: Iterable[Raw],
    store: Any = STORE,
    encoding: str = 'ros2msg',
    text: str | None = None,
    message_encoding: str = 'cdr',
    extra: Sequence[str] = (),
    **options: Any,
) -> bytes:
    """Return an MCAP file by foxglove's writer; ``extra`` are more topics without messages."""
    stream = io.BytesIO()
    options.setdefault('compression', CompressionType.ZSTD)
    writer = Writer(stream, **options)
    writer.start(profile='ros2')
    schemas: dict[str, int] = {}
    channels: dict[str, int] = {}

    def channel(topic: str, kind: str) -> int:
        if kind not in schemas:
            data = definition(kind, store) if text is None else text
            schemas[kind] = writer.register_schema(kind, encoding, data.encode())
        if topic not in channels:
            channels[topic] = writer.register_channel(topic, message_encoding, schemas[kind])
        return channels[topic]

    for topic in extra:
        channel(topic, 'std_msgs/msg/String')
    for item in messages:
        number = channel(item.topic, item.type)
        writer.add_message(number, item.bag_ns, item.data, item.bag_ns)
    writer.finish()
    return stream.getvalue()


def write_mcap(path: Path, messages: Iterable[Raw], **options: Any) -> Path:
    path.write_bytes(mcap_bytes(messages, **options))
    return path


# whole recordings as the data sheet says, without a bag


class Clocks(NamedTuple):
    """What the recorder sees of the on-board clock, and its own latency."""

    offset_s: float = 0.6
    drift_ppm: float = 22.0
    latency_s: float = 0.004
    jitter_s: float = 0.0008


CLOCKS = Clocks()


def synthetic(
    machine: Machine, duration_s: float = 60.0, seed: int = 1, clocks: Clocks = CLOCKS
) -> Recording:
    """Return a recording whose signals look like the machine's: loop, pitch, noise, rounding."""
    rng = np.random.default_rng(seed)
    signals: dict[str, Signal] = {}
    speed, pitch = 0.5, machine.chain.pitch_m
    loop_hz = speed / (pitch * machine.chain.n_links)
    arrivals: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    for i, sensor in enumerate(machine.instruments.sensors):
        time = np.arange(int(duration_s * sensor.rate_hz)) / sensor.rate_hz
        if sensor.topic not in arrivals:
            own = time
            if sensor.logger == 'on_board':
                own = clocks.offset_s + time * (1.0 + 1e-6 * clocks.drift_ppm)
            late = clocks.latency_s + rng.exponential(clocks.jitter_s, len(time))
            bag = np.maximum.accumulate(time + late)
            arrivals[sensor.topic] = (_nanoseconds(own), _nanoseconds(bag))
        stamp_ns, bag_ns = arrivals[sensor.topic]
        size = {'N': 1500.0, 'm': 1e-3, 'm/s2': 5.0}[sensor.unit] / abs(sensor.scale)
        common = np.sin(2 * np.pi * loop_hz * time + i) + 0.2 * np.sin(
            2 * np.pi * speed / pitch * time
        )
        k = len(sensor.fields)
        bending = np.asarray(sensor.bending or [0.0] * k)
        parts = size * (
            common[:, None] + 0.3 * bending * np.cos(2 * np.pi * loop_hz * time)[:, None]
        )
        parts = parts + sensor.zero * rng.uniform(-1.0, 1.0, k)
        parts = parts + sensor.noise * rng.standard_normal((len(time), k))
        if sensor.resolution:
            parts = np.round(parts / sensor.resolution) * sensor.resolution
        signals[sensor.channel] = make_signal(
            sensor.channel, sensor.unit, stamp_ns, bag_ns, parts * sensor.scale * sensor.sign
        )
    experiment = Experiment(speed, 1, (0.0,), 3000.0, case_id='made', machine=machine.name)
    return Recording('', signals, experiment)


def _nanoseconds(seconds: np.ndarray) -> np.ndarray:
    return START_NS + np.rint(seconds * 1e9).astype(np.int64)


def with_signal(recording: Recording, signal: Signal) -> Recording:
    return replace(recording, signals={**recording.signals, signal.channel: signal})


def changed(recording: Recording, channel: str, **arrays: Any) -> Recording:
    """Return the recording with some arrays of one channel replaced; a fault put in."""
    old = recording.signals[channel]
    new = {'stamp_ns': old.stamp_ns, 'bag_ns': old.bag_ns, 'parts': old.parts, **arrays}
    return with_signal(recording, make_signal(channel, old.unit, **new))


def kinds(recording: Recording) -> set[tuple[str, str]]:
    """Return what was found in a recording, beside topics that it lacks: kind and channel."""
    return {(f.kind, f.channel) for f in recording.findings if f.kind != 'missing_topic'}
