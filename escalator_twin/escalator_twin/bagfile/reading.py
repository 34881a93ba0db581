"""Read the machine's channels from a bag."""

from collections.abc import Iterable
import os

import numpy as np
from numpy.typing import NDArray

from escalator_twin.bagfile.gathering import collect, read_experiment, select, Topic
from escalator_twin.bagfile.source import Bag, TopicInfo, topics_of
from escalator_twin.bagfile.tidy import Tidy, tidy
from escalator_twin.conversions import parse_path
from escalator_twin.errors import RecordingError
from escalator_twin.machine import Machine, Sensor
from escalator_twin.signals import Finding, Floats, make_signal, Recording, Signal

# No physical quantity in SI comes near this; its square still is a number.
LARGEST = 1e100
# A part of a channel that is not finite in more than this share of the samples counts as dead.
MAX_NOT_FINITE = 0.1


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
        chosen = namespace or namespace_of(machine, infos)
        findings = _not_measured(machine, namespace, chosen)
        experiment_topic = _experiment_topic(machine, chosen)
        topics = _topics(machine, chosen)
        wanted = (set(topics) | {experiment_topic}) & present
        experiment = None
        start_ns = min((info.first_ns for info in infos if info.n_messages), default=0)
        for file, block in bag.blocks(wanted):
            for index in np.unique(block.channel):
                channel = file.channels[int(index)]
                part = select(block, int(index), bag.message_compression)
                if channel.topic == experiment_topic:
                    experiment = experiment or read_experiment(channel, part, findings)
                elif channel.topic in topics:
                    collect(topics[channel.topic], channel, part)
        signals: dict[str, Signal] = {}
        optional = {sensor.channel for sensor in machine.instruments.simulated_only}
        for topic in topics.values():
            if not topic.rows:
                findings += _missing(topic, optional)
                continue
            made, remarks = _signals(topic, start_ns)
            signals |= {signal.channel: signal for signal in made}
            findings += remarks
        findings += _losses(bag, signals, start_ns)
    order = [s.channel for s in _sensors(machine, chosen) if s.channel in signals]
    return Recording(
        str(path), {name: signals[name] for name in order}, experiment, tuple(findings)
    )


def require(recording: Recording, channels: Iterable[str], machine: Machine | None = None) -> None:
    """Raise a RecordingError that names missing channels, and why as far as reading told.

    Parameters
    ----------
    recording : Recording
        As read.
    channels : iterable of str
        What a question needs.
    machine : Machine, optional
        Adds the topics where they should have been.
    """
    missing = [name for name in channels if name not in recording.signals]
    if not missing:
        return
    where = ''
    if machine is not None:
        instruments = machine.instruments
        topics = (instruments.measured_topic(instruments.sensor(name).topic) for name in missing)
        where = f'; expected on the topics {", ".join(dict.fromkeys(topics))}'
    raise RecordingError(
        f'{recording.path or "recording"}: channels are missing: {", ".join(missing)}{where}'
    )


# which topics


def _sensors(machine: Machine, namespace: str) -> list[Sensor]:
    instruments = machine.instruments
    sensors = list(instruments.sensors)
    if namespace == instruments.simulated_namespace:
        sensors += instruments.simulated_only
    return sensors


def topic_name(machine: Machine, namespace: str, topic: str) -> str:
    """Return a topic of the description as it is called in ``namespace``."""
    instruments = machine.instruments
    if namespace == instruments.measured_namespace:
        return instruments.measured_topic(topic)
    return f'{namespace.rstrip("/")}/{topic.lstrip("/")}'


def namespace_of(machine: Machine, infos: Iterable[TopicInfo]) -> str:
    """Return where a bag has the machine's topics: the simulated only where none is measured."""
    instruments = machine.instruments
    measured, simulated = instruments.measured_namespace, instruments.simulated_namespace
    present = {info.topic for info in infos if info.n_messages}

    def has_any(where: str) -> bool:
        return any(topic_name(machine, where, s.topic) in present for s in instruments.sensors)

    return simulated if has_any(simulated) and not has_any(measured) else measured


def _not_measured(machine: Machine, asked: str | None, chosen: str) -> list[Finding]:
    """Return a finding where simulated topics stand in for measured ones."""
    measured = machine.instruments.measured_namespace
    if asked is not None or chosen == measured:
        return []
    text = f'none of the topics of {measured} is there: those of {chosen} are read instead'
    return [Finding('missing_topic', '', 0.0, 0.0, text)]


def _topics(machine: Machine, namespace: str) -> dict[str, Topic]:
    found: dict[str, list[Sensor]] = {}
    for sensor in _sensors(machine, namespace):
        found.setdefault(topic_name(machine, namespace, sensor.topic), []).append(sensor)
    return {name: Topic(name, sensors) for name, sensors in found.items()}


def _experiment_topic(machine: Machine, namespace: str) -> str:
    experiment = machine.instruments.experiment
    return topic_name(machine, namespace, experiment.topic) if experiment else ''


def _missing(topic: Topic, optional: set[str]) -> list[Finding]:
    """Say why a topic gave nothing."""
    reason = topic.problems[0] if topic.problems else 'no message'
    if topic.n_bad:
        reason = f'none of its {topic.n_bad} messages fits its type'
    return [
        Finding('missing_topic', sensor.channel, 0.0, 0.0, f'{topic.name}: {reason}')
        for sensor in topic.sensors
        if sensor.channel not in optional
    ]


def _signals(topic: Topic, start_ns: int) -> tuple[list[Signal], list[Finding]]:
    """Turn what a topic has gathered into signals and findings; empties the topic."""
    bag_ns = np.concatenate(topic.bag)
    from_s, to_s = ((int(t) - start_ns) / 1e9 for t in (bag_ns.min(), bag_ns.max()))
    stamps = np.concatenate(topic.stamps) if topic.has_header else None
    result = tidy(stamps, bag_ns, np.concatenate(topic.rows))
    topic.stamps, topic.bag, topic.rows = [], [], []
    if topic.n_bad:
        text = f'{topic.n_bad} messages do not fit their type'
        result.remarks.append(('data_gap', text, False))
    signals, findings = [], []
    for sensor in topic.sensors:
        index = [topic.paths.index(parse_path(text)) for text in sensor.fields]
        signal, remarks = _signal(sensor, result, result.fields[:, index])
        findings += [
            Finding(kind, sensor.channel, from_s, to_s, text, repaired)
            for kind, text, repaired in result.remarks + remarks
        ]
        if signal is not None:
            signals.append(signal)
    return signals, findings


def _signal(
    sensor: Sensor, result: Tidy, fields: Floats
) -> tuple[Signal | None, list[tuple[str, str, bool]]]:
    """Scale a sensor's fields to SI, leaving out what is no number."""
    fields = np.where(np.abs(fields) < LARGEST, fields, np.nan)
    parts = sensor.sign * sensor.scale * fields + sensor.offset
    is_kept = np.ones(len(parts), dtype=bool)
    remarks: list[tuple[str, str, bool]] = []
    if not np.isfinite(parts).all():
        parts, is_kept, mended = _finite(parts)
        remarks = [(kind, text, True) for kind, text in mended]
    if not is_kept.any():
        return None, [('missing_topic', 'no sample is a number', False)]
    signal = make_signal(
        sensor.channel,
        sensor.unit,
        result.stamp_ns[is_kept],
        result.bag_ns[is_kept],
        parts[is_kept],
    )
    return signal, remarks


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
