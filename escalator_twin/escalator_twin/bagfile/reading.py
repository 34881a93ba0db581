"""Read the machine's channels from a bag."""

from collections.abc import Iterable
import os

import numpy as np
from numpy.typing import NDArray

from escalator_twin.bagfile.container import MAX_TIME, Span
from escalator_twin.bagfile.gathering import collect, read_experiment, select, Topic
from escalator_twin.bagfile.source import Bag, TopicInfo, topics_of
from escalator_twin.bagfile.tidy import Tidy, tidy
from escalator_twin.case import case_beside
from escalator_twin.conversions import parse_path
from escalator_twin.errors import RecordingError
from escalator_twin.machine import Machine, Sensor
from escalator_twin.signals import Experiment, Finding, Floats, make_signal, Recording, Signal

# No physical quantity in SI comes near this; its square still is a number.
LARGEST = 1e100
# A part of a channel that is not finite in more than this share of the samples counts as dead.
MAX_NOT_FINITE = 0.1
# Messages this far outside a window of bag time decide on order and repetition inside, ns.
MARGIN_NS = 2_000_000_000
NO_NUMBERS = 'are no numbers'


def read(
    path: str | os.PathLike[str],
    machine: Machine,
    namespace: str | None = None,
    from_ns: int | None = None,
    to_ns: int | None = None,
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
    from_ns, to_ns : int, optional
        Bag time, [from_ns, to_ns): only these messages, the same that reading all would give
        there, and only their findings, whose times count from the window's begin. Chunks outside
        are skipped by their heads; the experiment is found wherever it is.

    Returns
    -------
    Recording
        The channels that are there, in SI, in the order of their stamps. What is missing or had
        to be mended is in ``findings``; `require` turns missing channels into an error.

    Raises
    ------
    BagError
        Where the container cannot be read.
    ExperimentError
        Where a file beside it, which tells what was set, cannot be used; see `case_beside`.
    """
    span = Span(from_ns or 0, MAX_TIME + 1 if to_ns is None else to_ns)
    with Bag(path) as bag:
        infos = topics_of(bag)
        chosen = namespace or namespace_of(machine, infos)
        findings = _not_measured(machine, namespace, chosen)
        first = {info.topic: info.first_ns for info in infos if info.n_messages}
        start_ns = max(min(first.values(), default=0), span.from_ns)
        experiment = _experiment(bag, _experiment_topic(machine, chosen), set(first), findings)
        topics = _topics(machine, chosen, span)
        _gather(bag, topics, set(first), span)
        signals: dict[str, Signal] = {}
        optional = {sensor.channel for sensor in machine.instruments.simulated_only}
        for topic in topics.values():
            made, remarks = _signals(topic, start_ns, first.get(topic.name))
            if not made and not remarks:
                remarks = _missing(topic, optional)
            signals |= {signal.channel: signal for signal in made}
            findings += remarks
        findings += _losses(bag, signals, start_ns)
    experiment = case_beside(path, machine, experiment)
    order = [s.channel for s in _sensors(machine, chosen) if s.channel in signals]
    return Recording(
        str(path), {name: signals[name] for name in order}, experiment, tuple(findings)
    )


def _gather(bag: Bag, topics: dict[str, Topic], present: set[str], span: Span) -> None:
    """Take the numbers of all topics out of the bag, and of a margin around the window."""
    wide = span.widened(MARGIN_NS)
    for file, block in bag.blocks(set(topics) & present, wide):
        for index in np.unique(block.channel):
            channel = file.channels[int(index)]
            if channel.topic in topics:
                part = select(block, int(index), bag.message_compression, wide)
                collect(topics[channel.topic], channel, part)


def _experiment(
    bag: Bag, topic: str, present: set[str], findings: list[Finding]
) -> Experiment | None:
    """Return the first experiment of a bag that can be read, reading no further."""
    if topic not in present:
        return None
    for file, block in bag.blocks({topic}):
        for index in np.unique(block.channel):
            channel = file.channels[int(index)]
            if channel.topic == topic:
                part = select(block, int(index), bag.message_compression)
                experiment = read_experiment(channel, part, findings)
                if experiment is not None:
                    return experiment
    return None


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


def _topics(machine: Machine, namespace: str, span: Span) -> dict[str, Topic]:
    found: dict[str, list[Sensor]] = {}
    for sensor in _sensors(machine, namespace):
        found.setdefault(topic_name(machine, namespace, sensor.topic), []).append(sensor)
    return {name: Topic(name, sensors, span=span) for name, sensors in found.items()}


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


def _signals(
    topic: Topic, start_ns: int, first_ns: int | None
) -> tuple[list[Signal], list[Finding]]:
    """Turn what a topic has gathered into signals and findings; empties the topic."""
    times = [part[topic.span.holds(part)] for part in topic.bag]
    inside = [(int(part.min()), int(part.max())) for part in times if len(part)]
    if not inside:
        return [], []
    from_s = (min(part[0] for part in inside) - start_ns) / 1e9
    to_s = (max(part[1] for part in inside) - start_ns) / 1e9
    stamps = np.concatenate(topic.stamps) if topic.has_header else None
    bag_ns, rows = np.concatenate(topic.bag), np.concatenate(topic.rows)
    topic.stamps, topic.bag, topic.rows = [], [], []
    result = tidy(stamps, bag_ns, rows, topic.span, first_ns)
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
        mended.append(('data_gap', f'{n_lost} samples {NO_NUMBERS}: dropped'))
    return parts, is_kept, mended


def _losses(bag: Bag, signals: dict[str, Signal], start_ns: int) -> list[Finding]:
    """Return what of the container was lost as findings."""
    end_ns = max((int(s.bag_ns[-1]) for s in signals.values()), default=start_ns)
    end_s = (end_ns - start_ns) / 1e9
    return [Finding('data_gap', '', 0.0, end_s, text) for text in bag.losses]
