"""What the simulator publishes: topics of the machine's sensors, and their messages."""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from escalator_twin.bagfile.cdr import walk
from escalator_twin.bagfile.definitions import normalise_type, typestore_for
from escalator_twin.bagfile.encoding import encode
from escalator_twin.bagfile.writing import ABSENT
from escalator_twin.conversions import experiment_values, parse_path, Path, STAMP
from escalator_twin.errors import EscalatorError, MachineError
from escalator_twin.machine import Machine, Sensor
from escalator_twin.signals import Experiment, Floats, Nanoseconds

NS = 1_000_000_000
FRAME: Path = ('header', 'frame_id')
POSITION_TYPE = 'escalator_msgs/msg/LoopPosition'
POSITION: Path = ('s',)


def simulated_name(machine: Machine, topic: str) -> str:
    """Return the relative name of the topic on which the twin publishes ``topic``."""
    return machine.instruments.simulated_topic(topic).lstrip('/')


def measured_name(machine: Machine, topic: str) -> str:
    """Return the name of a measured topic: relative, unless the description gives it in full."""
    if topic.startswith('/'):
        return topic
    return machine.instruments.measured_topic(topic).lstrip('/')


def measured_topics(machine: Machine) -> list[str]:
    """Return the topics of a recording as the description names them, the experiment's first."""
    instruments = machine.instruments
    topics = [instruments.experiment.topic] if instruments.experiment is not None else []
    return list(dict.fromkeys(topics + [sensor.topic for sensor in instruments.sensors]))


def has_header(kind: str) -> bool:
    """Tell whether a message type has a header, and with it a stamp of its own."""
    types = typestore_for({kind}).fielddefs
    return kind in types and any(
        name == 'header' and detail == 'std_msgs/msg/Header'
        for name, (_, detail) in types[kind][1]
    )


def message_class(name: str, topic: str) -> Any:
    """Return the Python class of a message type.

    Raises
    ------
    EscalatorError
        Where its package is not installed or has no such type.
    """
    package, _, kind = normalise_type(name).split('/')
    try:
        return getattr(import_module(f'{package}.msg'), kind)
    except (ImportError, AttributeError) as error:
        raise EscalatorError(f'{topic}: the type {name} is not installed') from error


@dataclass(frozen=True)
class Output:
    """One topic of the twin.

    Attributes
    ----------
    name : str
        Relative to the node's namespace.
    type : str
    sensors : tuple of Sensor
        Whose fields its messages hold.
    columns : tuple of int
        Where these are among all sensors.
    rate_hz : float
        The instrument's own.
    is_measured : bool
        Whether a recording has it too.
    """

    name: str
    type: str
    sensors: tuple[Sensor, ...]
    columns: tuple[int, ...]
    rate_hz: float
    is_measured: bool


def sensors_of(machine: Machine) -> tuple[Sensor, ...]:
    """Return all that the simulator computes, the recordings' sensors first."""
    return machine.instruments.sensors + machine.instruments.simulated_only


def outputs_of(machine: Machine) -> tuple[Output, ...]:
    """Return the twin's topics in the order of the machine's description."""
    groups: dict[tuple[str, str], list[int]] = {}
    sensors = sensors_of(machine)
    for i, sensor in enumerate(sensors):
        groups.setdefault((sensor.topic, sensor.type), []).append(i)
    measured = len(machine.instruments.sensors)
    return tuple(
        Output(
            simulated_name(machine, topic),
            kind,
            tuple(sensors[i] for i in members),
            tuple(members),
            max(sensors[i].rate_hz for i in members),
            min(members) < measured,
        )
        for (topic, kind), members in groups.items()
    )


def check_same_topics(machine: Machine, other: Machine, path: str) -> None:
    """Raise a MachineError where a machine's topics or its number of links are not another's.

    Parameters
    ----------
    machine, other : Machine
    path : str
        Of the first one.
    """
    found, expected = (
        (m.chain.n_links, [(o.name, o.type, o.columns, o.rate_hz) for o in outputs_of(m)])
        for m in (machine, other)
    )
    if found != expected:
        raise MachineError(
            f'{path}: machine: expected the topics and the {other.chain.n_links} links of '
            f'{other.name}, found other ones of {machine.name}'
        )


def position_output(machine: Machine) -> Output:
    """Return the topic that tells where the chain is."""
    return Output(simulated_name(machine, 'loop_position'), POSITION_TYPE, (), (), 0.0, True)


class Encoder:
    """Makes messages of one type, whose numbers are the same fields each time.

    One message is built by its definition; the others are its bytes with other numbers.

    Parameters
    ----------
    kind : str
        Message type.
    labels : mapping of path to value
        What is the same in all messages.
    paths : tuple of paths
        The numbers that change, beside the header's stamp.
    """

    def __init__(
        self, kind: str, labels: Mapping[Path, float | int | str], paths: tuple[Path, ...]
    ) -> None:
        types = typestore_for({kind}).fielddefs
        if kind not in types:
            raise MachineError(f'no definition of the type {kind!r}')
        raw = encode(kind, types, {**dict.fromkeys(paths, 0), **labels})
        places = walk(raw, kind, types, {*paths, *STAMP}).places
        self._template = np.frombuffer(raw, np.uint8)
        self._numbers = [places[path] for path in paths]
        self._stamp = [places[path] for path in STAMP if path in places]

    def encode(self, stamp_ns: Nanoseconds, values: Floats) -> list[bytes]:
        """Return one message for each stamp.

        Parameters
        ----------
        stamp_ns : (n,) int64
            For the header, where there is one.
        values : (n, k) float64
            One column for each path.
        """
        rows = np.tile(self._template, (len(stamp_ns), 1))
        columns = list(np.divmod(stamp_ns, NS)) if self._stamp else []
        for place, column in zip(
            [*self._stamp, *self._numbers], [*columns, *values.T], strict=True
        ):
            if place.dtype.kind in 'iu':
                column = np.rint(column)
            cells = np.ascontiguousarray(column.astype(place.dtype)[:, None]).view(np.uint8)
            rows[:, place.offset : place.offset + place.dtype.itemsize] = cells
        data = rows.tobytes()
        size = rows.shape[1]
        return [data[i : i + size] for i in range(0, len(data), size)]


class SensorEncoder:
    """Makes the messages of one of the twin's topics from simulated values."""

    def __init__(self, output: Output) -> None:
        labels: dict[Path, float | int | str] = {
            parse_path(text): value for text, value in ABSENT.get(output.type, {}).items()
        }
        first = output.sensors[0]
        labels[FRAME] = first.name if first.labels else first.instrument
        paths: list[Path] = []
        for sensor in output.sensors:
            labels |= {parse_path(k): _plain(v) for k, v in sensor.labels.items()}
            paths += [parse_path(text) for text in sensor.fields]
        if not has_header(output.type):
            del labels[FRAME]
        self._output = output
        self._encoder = Encoder(output.type, labels, tuple(paths))

    def encode(self, stamp_ns: Nanoseconds, columns: Floats) -> list[bytes]:
        """Return one message for each stamp; ``columns`` (n, all sensors) is in SI."""
        values = [
            (columns[:, i] - sensor.offset) / (sensor.sign * sensor.scale)
            for i, sensor in zip(self._output.columns, self._output.sensors, strict=True)
            for _ in sensor.fields
        ]
        return self._encoder.encode(stamp_ns, np.column_stack(values))


def experiment_message(machine: Machine, experiment: Experiment, stamp_ns: int) -> bytes:
    """Return the message that tells an experiment's settings."""
    topic = machine.instruments.experiment
    assert topic is not None
    types = typestore_for({topic.type}).fielddefs
    stamp = dict(zip(STAMP, divmod(stamp_ns, NS), strict=True))
    return encode(topic.type, types, {**experiment_values(experiment), **stamp})


def _plain(value: object) -> float | int | str:
    return value if isinstance(value, float | int | str) else str(value)
