"""Check a long recording window by window, in memory that does not grow with it.

Windows are cut by bag time. What is told of one channel's stamps and samples is settled only up to
a second before a window's end: the rest is looked at again with the next window, so that nothing
at an edge is invented, missed or told twice.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from escalator_twin.check.clock import ClockComparison
from escalator_twin.check.drift import Course, is_followed, judge_courses
from escalator_twin.check.gaps import edges, join_steps, judge_steps, Steps, steps_of
from escalator_twin.check.merging import merge_reading, merge_values
from escalator_twin.check.quality import clock_findings, DETECTORS, is_beside
from escalator_twin.check.spikes import find_hits, Hits, join_hits, judge_hits
from escalator_twin.machine import Machine, Sensor
from escalator_twin.signals import Experiment, Finding, make_signal, Recording, Signal

TAIL_NS = 2_000_000_000  # of a window that is kept for the next one
SETTLED_NS = 1_000_000_000  # before a window's end: what comes late may still go there
CLOCK_STEP_NS = 250_000_000  # as in reading: a step of the logger's clock
FOREVER = np.iinfo(np.int64).max


@dataclass
class _Channel:
    """What is known of one channel so far."""

    sensor: Sensor
    first_ns: int
    tail: Signal
    course: Course | None = None
    settled_ns: int = 0
    last_ns: int = 0
    steps: list[Steps] = field(default_factory=list)
    hits: list[Hits] = field(default_factory=list)
    values: list[Finding] = field(default_factory=list)


class Survey:
    """All that `quality` finds, gathered from one window after the other."""

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        self.experiment: Experiment | None = None
        self._channels: dict[str, _Channel] = {}
        self._starts: dict[str, int] = {}  # of loggers, by their own clocks
        self._reading: list[Finding] = []
        self._missing: list[dict[str, Finding]] = []

    @property
    def rates_hz(self) -> dict[str, float]:
        """Median rate by channel."""
        return {
            name: 1.0 / join_steps(channel.steps).period_s
            for name, channel in self._channels.items()
            if channel.steps
        }

    def add(self, recording: Recording, from_s: float) -> Recording:
        """Take the next window, which begins ``from_s`` after the recording.

        Returns
        -------
        Recording
            With the steps of earlier windows undone in the stamps.
        """
        self.experiment = self.experiment or recording.experiment
        self._take_findings(recording, from_s)
        signals = {c: self._continued(s) for c, s in recording.signals.items()}
        present = [s for s in self.machine.instruments.sensors if s.channel in signals]
        for sensor in present:
            first = int(signals[sensor.channel].stamp_ns[0])
            known = self._starts.get(sensor.logger)
            is_new = sensor.channel not in self._channels
            if known is None or (is_new and first < known):
                self._starts[sensor.logger] = first
        joined = {s.channel: self._joined(signals[s.channel], s) for s in present}
        for sensor in present:
            others = [(joined[o.channel], o) for o in present if is_beside(o, sensor)]
            self._take(signals[sensor.channel], joined[sensor.channel], others)
        return replace(recording, signals=signals)

    def findings(self, clock: ClockComparison) -> list[Finding]:
        """Return the findings of the whole recording; the last window has been added."""
        self._flush()
        found = merge_reading(self._reading, self._missing)
        for logger, start in self._starts.items():
            members = [c for c in self._channels.values() if c.sensor.logger == logger]
            ends = [(c.sensor, c.first_ns, c.last_ns) for c in members]
            found += edges(ends, start, max(c.last_ns for c in members))
            for channel in members:
                if channel.steps:
                    found += judge_steps(join_steps(channel.steps), channel.sensor)
                found += merge_values(channel.values, 1.5 / channel.sensor.rate_hz)
                span_s = (channel.last_ns - channel.first_ns) / 1e9
                if channel.hits:
                    found += judge_hits(join_hits(channel.hits), channel.tail, span_s, start)
        courses = {n: c.course for n, c in self._channels.items() if c.course is not None}
        faulty = {finding.channel for finding in found}
        found += judge_courses(courses, self.experiment, self.machine, faulty)
        return found + clock_findings(clock, self.machine)

    def _take_findings(self, recording: Recording, from_s: float) -> None:
        missing = {}
        for finding in recording.findings:
            moved = replace(finding, from_s=finding.from_s + from_s, to_s=finding.to_s + from_s)
            if finding.kind == 'missing_topic' and finding.channel:
                missing[finding.channel] = finding
            else:
                self._reading.append(moved)
        self._missing.append(missing)

    def _continued(self, signal: Signal) -> Signal:
        """Return a signal with the logger's clock as the windows before left it."""
        known = self._channels.get(signal.channel)
        if known is None or len(signal.stamp_ns) < 2:
            return signal
        forward = int(signal.stamp_ns[0] - known.tail.stamp_ns[-1])
        arrival = int(signal.bag_ns[0] - known.tail.bag_ns[-1])
        step = forward - int(np.median(np.diff(signal.stamp_ns)))
        if not 0 <= arrival < CLOCK_STEP_NS or abs(step) <= CLOCK_STEP_NS:
            return signal
        return replace(signal, stamp_ns=signal.stamp_ns - step)

    def _joined(self, signal: Signal, sensor: Sensor) -> Signal:
        """Return the new samples behind what is kept of the window before."""
        known = self._channels.get(signal.channel)
        if known is not None:
            return _join(known.tail, signal)
        self._channels[signal.channel] = _Channel(
            sensor, int(signal.stamp_ns[0]), _cut(signal, slice(0, 0))
        )
        return signal

    def _take(self, new: Signal, joined: Signal, others: Sequence[tuple[Signal, Sensor]]) -> None:
        """Look at one channel's samples."""
        channel = self._channels[new.channel]
        last = int(joined.stamp_ns[-1])
        self._settle(channel, joined, others, last - SETTLED_NS)
        channel.last_ns = max(channel.last_ns, last)
        start = self._starts[channel.sensor.logger]
        still, *rest = DETECTORS
        for detector, signal in [(still, joined), *((d, new) for d in rest)]:
            if len(signal.values) >= 3:
                time_s = (signal.stamp_ns - start) / 1e9
                channel.values += detector(signal, channel.sensor, time_s)
        if is_followed(channel.sensor):
            if channel.course is None:
                channel.course = Course(new)
            else:
                channel.course.add(new)
        kept = np.searchsorted(joined.stamp_ns, last - TAIL_NS)
        channel.tail = _cut(joined, slice(int(kept), None))

    def _settle(
        self,
        channel: _Channel,
        joined: Signal,
        others: Sequence[tuple[Signal, Sensor]],
        until_ns: int,
    ) -> None:
        """Take stock of the stamps and outliers up to ``until_ns``."""
        start = self._starts[channel.sensor.logger]
        low, high = np.searchsorted(joined.stamp_ns, [channel.settled_ns, until_ns])
        stamps = joined.stamp_ns[max(int(low) - 1, 0) : int(high)]
        if len(stamps) >= 2:
            channel.steps.append(steps_of(stamps, start))
        if len(joined.values) >= 3:
            hits = find_hits(joined, channel.sensor, list(others))
            channel.hits.append(hits.cut(channel.settled_ns, until_ns))
        channel.settled_ns = max(channel.settled_ns, until_ns)

    def _flush(self) -> None:
        """Settle what was kept for a next window."""
        for channel in self._channels.values():
            others = [
                (other.tail, other.sensor)
                for other in self._channels.values()
                if is_beside(other.sensor, channel.sensor)
            ]
            self._settle(channel, channel.tail, others, FOREVER)


def _cut(signal: Signal, rows: slice) -> Signal:
    return make_signal(
        signal.channel,
        signal.unit,
        signal.stamp_ns[rows],
        signal.bag_ns[rows],
        signal.parts[rows],
    )


def _join(tail: Signal, signal: Signal) -> Signal:
    """Return both in the order of their stamps."""
    stamp = np.concatenate([tail.stamp_ns, signal.stamp_ns])
    order = np.argsort(stamp, kind='stable')
    bag = np.concatenate([tail.bag_ns, signal.bag_ns])[order]
    parts = np.concatenate([tail.parts, signal.parts])[order]
    return make_signal(signal.channel, signal.unit, stamp[order], bag, parts)
