"""The document of the verb `check`."""

from dataclasses import asdict
import itertools
import math
import os
from typing import Any, NamedTuple

import numpy as np

from escalator_twin.bagfile import read
from escalator_twin.bagfile.reading import namespace_of, topic_name
from escalator_twin.bagfile.source import Bag, TopicInfo, topics_of
from escalator_twin.check.clock import ClockComparison, compare_clocks
from escalator_twin.check.clockwindows import ClockSurvey
from escalator_twin.check.quality import quality
from escalator_twin.check.windows import Survey
from escalator_twin.machine import Machine
from escalator_twin.signals import Experiment, Finding

SCHEMA = 'escalator_twin/check/1'
LONG_S = 720.0  # a longer recording is looked at in windows
WINDOW_S = 480.0


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
    bounds = windows_of(infos, machine, LONG_S, WINDOW_S)
    looked = _in_windows(path, machine, infos, bounds) if bounds else _at_once(path, machine)
    container['losses'] += [
        f.detail
        for f in looked.findings
        if not f.channel and f.kind == 'data_gap' and f.detail not in container['losses']
    ]
    findings = looked.findings + _experiment_missing(looked, machine)
    experiment = looked.experiment
    return {
        'schema': SCHEMA,
        'path': str(path),
        'case_id': experiment.case_id if experiment else None,
        'experiment': asdict(experiment) if experiment else None,
        'container': container,
        'topics': _topics(infos, looked.rates_hz, machine),
        'clock': looked.clock.document(),
        'quality': [asdict(finding) for finding in findings],
    }


class _Looked(NamedTuple):
    """What looking at the signals gave."""

    experiment: Experiment | None
    rates_hz: dict[str, float]  # of the channels that are there
    clock: ClockComparison
    findings: list[Finding]


def _at_once(path: str | os.PathLike[str], machine: Machine) -> _Looked:
    recording = read(path, machine)
    clock = compare_clocks(recording, machine)
    rates = {name: signal.rate_hz for name, signal in recording.signals.items()}
    return _Looked(recording.experiment, rates, clock, quality(recording, machine, clock))


def windows_of(
    infos: list[TopicInfo], machine: Machine, long_s: float, window_s: float
) -> list[tuple[int, int]]:
    """Return the windows of bag time in which a recording longer than ``long_s`` is looked at.

    They are at most about ``window_s`` long; none where the recording is short.
    """
    spans = _spans(infos, machine)
    if not spans:
        return []
    first, last = min(span[0] for span in spans.values()), max(span[1] for span in spans.values())
    if last - first <= long_s * 1e9:
        return []
    # damaged times span anything: no more windows than the messages can fill
    namespace = namespace_of(machine, infos)
    rates = {
        topic_name(machine, namespace, s.topic): s.rate_hz for s in machine.instruments.sensors
    }
    filled_s = sum(info.n_messages for info in infos if info.topic in rates) / sum(rates.values())
    if 4.0 * filled_s <= long_s:
        return []
    n = math.ceil(min((last - first) / 1e9, 4.0 * filled_s) / window_s)
    bounds = np.linspace(first, last + 1, n + 1).astype(np.int64).tolist()
    # on the edges of the clocks' bins, so that none of these is cut
    clocks = ClockSurvey(machine, spans)
    if clocks.edges is not None:
        marks = clocks.origin + np.rint(1e9 * clocks.edges).astype(np.int64)
        nearest = [int(marks[np.argmin(np.abs(marks - bound))]) for bound in bounds[1:-1]]
        bounds = [first, *sorted(set(nearest)), last + 1]
    return list(itertools.pairwise(bounds))


def _spans(infos: list[TopicInfo], machine: Machine) -> dict[str, tuple[int, int]]:
    """Return first and last bag time of each logger that has messages."""
    namespace = namespace_of(machine, infos)
    loggers = {
        topic_name(machine, namespace, s.topic): s.logger for s in machine.instruments.sensors
    }
    spans: dict[str, tuple[int, int]] = {}
    for info in infos:
        if info.n_messages and (logger := loggers.get(info.topic)) is not None:
            first, last = spans.get(logger, (info.first_ns, info.last_ns))
            spans[logger] = (min(first, info.first_ns), max(last, info.last_ns))
    return spans


def _in_windows(
    path: str | os.PathLike[str],
    machine: Machine,
    infos: list[TopicInfo],
    bounds: list[tuple[int, int]],
) -> _Looked:
    """Look at one window after the other; no more than one is held."""
    survey, clocks = Survey(machine), ClockSurvey(machine, _spans(infos, machine))
    start = min(info.first_ns for info in infos if info.n_messages)
    for from_ns, to_ns in bounds:
        recording = read(path, machine, from_ns=from_ns, to_ns=to_ns)
        clocks.add(survey.add(recording, (from_ns - start) / 1e9))
        del recording
    clock = clocks.comparison()
    findings = survey.findings(clock)
    return _Looked(survey.experiment, survey.rates_hz, clock, findings)


def _experiment_missing(looked: _Looked, machine: Machine) -> list[Finding]:
    described = machine.instruments.experiment
    if described is None or looked.experiment is not None or not looked.rates_hz:
        return []
    topic = machine.instruments.measured_topic(described.topic)
    return [Finding('missing_topic', '', 0.0, 0.0, f'{topic}: no experiment')]


def _topics(
    infos: list[TopicInfo], rates_hz: dict[str, float], machine: Machine
) -> list[dict[str, Any]]:
    """Return all topics of the recording, then those that are expected and missing."""
    expected, types = _expected(machine, namespace_of(machine, infos))
    start = min((info.first_ns for info in infos if info.n_messages), default=0)
    rows = [_found(info, expected, rates_hz, start) for info in infos]
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
    info: TopicInfo, expected: dict[str, list[str]], rates_hz: dict[str, float], start_ns: int
) -> dict[str, Any]:
    """Return what is known of a topic that the recording has."""
    channels = [c for c in expected.get(info.topic, []) if c in rates_hz]
    span = (info.last_ns - info.first_ns) / 1e9
    by_bag = (info.n_messages - 1) / span if span > 0.0 else None
    return {
        'topic': info.topic,
        'type': info.type,
        'found': True,
        'expected': info.topic in expected,
        'channels': channels,
        'n_messages': info.n_messages,
        'rate_hz': rates_hz[channels[0]] if channels else by_bag,
        'first_s': (info.first_ns - start_ns) / 1e9 if info.n_messages else None,
        'last_s': (info.last_ns - start_ns) / 1e9 if info.n_messages else None,
        'serialization': info.serialization,
    }
