"""The document of the verb `check`."""

from dataclasses import asdict
import os
from typing import Any

from escalator_twin.bagfile import read
from escalator_twin.bagfile.reading import namespace_of, topic_name
from escalator_twin.bagfile.source import Bag, TopicInfo, topics_of
from escalator_twin.check.clock import compare_clocks
from escalator_twin.check.quality import quality
from escalator_twin.machine import Machine
from escalator_twin.signals import Finding, Recording

SCHEMA = 'escalator_twin/check/1'


def check(path: str | os.PathLike[str], machine: Machine) -> dict[str, Any]:
    """Read a recording and judge it without a model.

    Returns
    -------
    dict
        ``schema, path, container, experiment, topics, clock, quality``; a topic of the machine
        that is not in the recording has ``found: false``.

    Raises
    ------
    BagError
        Where the container cannot be read.
    """
    with Bag(path) as bag:
        infos = topics_of(bag)
        container = {
            'files': [file.name for file in bag.paths],
            'losses': list(bag.losses),
            'notes': list(bag.notes),
        }
    recording = read(path, machine)
    container['losses'] += [
        f.detail
        for f in recording.findings
        if not f.channel and f.kind == 'data_gap' and f.detail not in container['losses']
    ]
    clock = compare_clocks(recording, machine)
    findings = quality(recording, machine, clock) + _experiment_missing(recording, machine)
    experiment = recording.experiment
    return {
        'schema': SCHEMA,
        'path': str(path),
        'case_id': experiment.case_id if experiment else None,
        'experiment': asdict(experiment) if experiment else None,
        'container': container,
        'topics': _topics(infos, recording, machine),
        'clock': clock.document(),
        'quality': [asdict(finding) for finding in findings],
    }


def _experiment_missing(recording: Recording, machine: Machine) -> list[Finding]:
    described = machine.instruments.experiment
    if described is None or recording.experiment is not None or not recording.signals:
        return []
    topic = machine.instruments.measured_topic(described.topic)
    return [Finding('missing_topic', '', 0.0, 0.0, f'{topic}: no experiment')]


def _topics(
    infos: list[TopicInfo], recording: Recording, machine: Machine
) -> list[dict[str, Any]]:
    """Return all topics of the recording, then those that are expected and missing."""
    expected, types = _expected(machine, namespace_of(machine, infos))
    start = min((info.first_ns for info in infos if info.n_messages), default=0)
    rows = [_found(info, expected, recording, start) for info in infos]
    there = {info.topic for info in infos if info.n_messages}
    missing = {
        'found': False,
        'expected': True,
        'n_messages': 0,
        'rate_hz': None,
        'first_s': None,
        'last_s': None,
        'serialization': None,
    }
    rows += [
        {'topic': name, 'type': types[name], 'channels': channels, **missing}
        for name, channels in expected.items()
        if name not in there
    ]
    return rows


def _expected(machine: Machine, namespace: str) -> tuple[dict[str, list[str]], dict[str, str]]:
    """Return topic -> channels and topic -> type, as the machine says."""
    channels: dict[str, list[str]] = {}
    types: dict[str, str] = {}
    for sensor in machine.instruments.sensors:
        name = topic_name(machine, namespace, sensor.topic)
        channels.setdefault(name, []).append(sensor.channel)
        types[name] = sensor.type
    if experiment := machine.instruments.experiment:
        name = topic_name(machine, namespace, experiment.topic)
        channels.setdefault(name, [])
        types[name] = experiment.type
    return channels, types


def _found(
    info: TopicInfo, expected: dict[str, list[str]], recording: Recording, start_ns: int
) -> dict[str, Any]:
    """Return what is known of a topic that the recording has."""
    channels = [c for c in expected.get(info.topic, []) if c in recording.signals]
    span = (info.last_ns - info.first_ns) / 1e9
    by_bag = (info.n_messages - 1) / span if span > 0.0 else None
    return {
        'topic': info.topic,
        'type': info.type,
        'found': True,
        'expected': info.topic in expected,
        'channels': channels,
        'n_messages': info.n_messages,
        'rate_hz': recording.signals[channels[0]].rate_hz if channels else by_bag,
        'first_s': (info.first_ns - start_ns) / 1e9 if info.n_messages else None,
        'last_s': (info.last_ns - start_ns) / 1e9 if info.n_messages else None,
        'serialization': info.serialization,
    }
