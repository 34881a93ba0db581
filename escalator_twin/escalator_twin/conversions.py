"""Numbers from messages and back, by field path; no message type is known here.

Works alike on messages of rclpy, rosbags and mcap_ros2, whose fields have the same names.
"""

from collections.abc import Iterable
from functools import lru_cache
import re
from typing import Any

from escalator_twin.errors import MachineError
from escalator_twin.machine import Sensor
from escalator_twin.signals import Experiment

Path = tuple[str | int, ...]
STAMP: tuple[Path, Path] = (('header', 'stamp', 'sec'), ('header', 'stamp', 'nanosec'))
_PART = re.compile(r'(?:^|\.)([A-Za-z_][A-Za-z0-9_]*)|\[(\d+)\]')


@lru_cache(maxsize=1024)
def parse_path(text: str) -> Path:
    """Split a field path: ``poses[2].position.x`` is ``('poses', 2, 'position', 'x')``.

    Raises
    ------
    MachineError
        Where ``text`` is no field path.
    """
    parts: list[str | int] = []
    position = 0
    while position < len(text):
        match = _PART.match(text, position)
        if match is None or (not parts and text[0] in '.['):
            break
        parts.append(match.group(1) or int(match.group(2)))
        position = match.end()
    if not parts or position != len(text):
        raise MachineError(f'field path {text!r}: expected a form like strain[0] or force.x')
    return tuple(parts)


def path_text(path: Path) -> str:
    """Return a path as it is written in a machine description."""
    text = ''.join(f'[{part}]' if isinstance(part, int) else f'.{part}' for part in path)
    return text.removeprefix('.')


def get_field(message: Any, path: Path) -> Any:
    """Return the field at ``path``.

    Raises
    ------
    KeyError
        Where the message has no such field.
    """
    for part in path:
        try:
            message = message[part] if isinstance(part, int) else getattr(message, part)
        except (AttributeError, IndexError, TypeError):
            raise KeyError(path) from None
    return message


def set_field(message: Any, path: Path, value: Any) -> None:
    """Set the field at ``path``, in the type that it has now.

    Raises
    ------
    KeyError
        Where the message has no such field.
    """
    *above, last = path
    owner = get_field(message, tuple(above))
    if isinstance(last, int):
        while not hasattr(owner, 'shape') and hasattr(owner, 'append') and len(owner) <= last:
            owner.append(0.0)
        owner[last] = value
        return
    now = get_field(owner, (last,))
    setattr(owner, last, type(now)(value) if isinstance(now, bool | int | float | str) else value)


def stamp_ns(message: Any) -> int | None:
    """Return a message's own time, nanoseconds; ``None`` where its type has no header."""
    header = getattr(message, 'header', None)
    stamp = getattr(header, 'stamp', None)
    if stamp is None:
        return None
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def set_stamp(message: Any, time_ns: int) -> None:
    """Set a message's own time where its type has a header."""
    header = getattr(message, 'header', None)
    if header is not None:
        header.stamp.sec, header.stamp.nanosec = divmod(int(time_ns), 1_000_000_000)


def parts_of(message: Any, sensor: Sensor) -> list[float]:
    """Return a sensor's parts in SI: ``sign * scale * field + offset``, one a field.

    Raises
    ------
    KeyError
        Where the message lacks a field.
    """
    gain = sensor.sign * sensor.scale
    return [
        gain * float(get_field(message, parse_path(text))) + sensor.offset
        for text in sensor.fields
    ]


def fill(message: Any, sensor: Sensor, parts: Iterable[float]) -> None:
    """Write a sensor's parts (SI) and its labels into a message; the inverse of `parts_of`."""
    gain = sensor.sign * sensor.scale
    for text, value in sensor.labels.items():
        set_field(message, parse_path(text), value)
    for text, part in zip(sensor.fields, parts, strict=True):
        set_field(message, parse_path(text), (float(part) - sensor.offset) / gain)


def experiment_of(message: Any) -> Experiment:
    """Return the settings that an experiment message tells.

    Raises
    ------
    ExperimentError
        Where a setting cannot be.
    KeyError
        Where the message lacks a setting.
    """
    return Experiment(
        set_speed_m_s=float(get_field(message, ('set_speed',))),
        direction=int(get_field(message, ('direction',))),
        load_per_step_kg=(float(get_field(message, ('load_per_step',))),),
        preload_n=float(get_field(message, ('preload',))),
        case_id=str(getattr(message, 'case_id', '')),
        machine=str(getattr(message, 'machine', '')),
        notes=str(getattr(message, 'notes', '')),
    )


def experiment_values(experiment: Experiment) -> dict[Path, float | int | str]:
    """Return the fields of an experiment message; the load is the mean over the steps."""
    loads = experiment.load_per_step_kg
    return {
        ('machine',): experiment.machine,
        ('case_id',): experiment.case_id,
        ('set_speed',): experiment.set_speed_m_s,
        ('direction',): experiment.direction,
        ('load_per_step',): sum(loads) / len(loads),
        ('preload',): experiment.preload_n,
        ('notes',): experiment.notes,
    }
