"""All that is wrong with a recording as far as it shows without a model."""

from collections.abc import Callable
from typing import NamedTuple

from escalator_twin.check.clock import ClockComparison, compare_clocks
from escalator_twin.check.drift import drifts
from escalator_twin.check.gaps import edges, sampling
from escalator_twin.check.spikes import find_hits, judge_hits
from escalator_twin.check.still import stillness
from escalator_twin.check.values import hum, saturation
from escalator_twin.machine import Machine, Sensor
from escalator_twin.signals import Finding, Floats, Recording, Signal

# A clock may be this much worse than its description before that is told: the description's limits
# are round, and three tolerances of the on-board drift, 60 ppm, are 1.2 times 50 ppm.
CLOCK_SHARE = 1.2

Detector = Callable[[Signal, Sensor, Floats], list[Finding]]
# what looks at one channel by itself; the first needs the samples before a window too
DETECTORS: tuple[Detector, ...] = (stillness, saturation, hum)


class _Channel(NamedTuple):
    signal: Signal
    sensor: Sensor


def quality(
    recording: Recording, machine: Machine, clock: ClockComparison | None = None
) -> list[Finding]:
    """Return the findings of reading a recording and those that its signals show.

    Parameters
    ----------
    recording : Recording
        As read; times of findings are seconds from its logger's first stamp.
    machine : Machine
        Describes the sensors: rate, noise, resolution, clocks.
    clock : ClockComparison, optional
        Where it was computed already.
    """
    findings = list(recording.findings)
    channels = [
        _Channel(recording.signals[sensor.channel], sensor)
        for sensor in machine.instruments.sensors
        if sensor.channel in recording.signals
    ]
    for members in _by_logger(channels).values():
        start = min(int(c.signal.stamp_ns[0]) for c in members)
        end = max(int(c.signal.stamp_ns[-1]) for c in members)
        stamps = [(c.sensor, c.signal.stamp_ns) for c in members]
        findings += edges([(s, int(t[0]), int(t[-1])) for s, t in stamps], start, end)
        for signal, sensor in members:
            findings += sampling(signal, sensor, start)
            if len(signal.values) < 3:
                continue
            time_s = (signal.stamp_ns - start) / 1e9
            for detector in DETECTORS:
                findings += detector(signal, sensor, time_s)
            others = [(c.signal, c.sensor) for c in members if is_beside(c.sensor, sensor)]
            hits = find_hits(signal, sensor, others)
            findings += judge_hits(hits, signal, float(time_s[-1] - time_s[0]), start)
    faulty = {finding.channel for finding in findings}
    findings += drifts(recording, machine, faulty)
    findings += clock_findings(clock or compare_clocks(recording, machine), machine)
    return findings


def is_beside(other: Sensor, sensor: Sensor) -> bool:
    """Tell whether another channel comes in the same messages."""
    return other.topic == sensor.topic and other.channel != sensor.channel


def _by_logger(channels: list[_Channel]) -> dict[str, list[_Channel]]:
    found: dict[str, list[_Channel]] = {}
    for channel in channels:
        found.setdefault(channel.sensor.logger, []).append(channel)
    return found


def clock_findings(clock: ClockComparison, machine: Machine) -> list[Finding]:
    """Judge the loggers' clocks against what the machine says of them."""
    findings = [Finding('clock_disagreement', '', 0.0, 0.0, text) for text in clock.remarks]
    if clock.offset_s is None or clock.drift_ppm is None or clock.drift_high_ppm is None:
        return findings
    limit = machine.instruments.loggers[clock.logger]
    doubt = clock.drift_high_ppm - clock.drift_ppm
    if limit.drift_ppm and abs(clock.drift_ppm) > CLOCK_SHARE * limit.drift_ppm + doubt:
        text = (
            f'the clock of {clock.logger} runs {clock.drift_ppm:+.1f} ppm against '
            f'{clock.reference}, at most {limit.drift_ppm:g} ppm expected'
        )
        findings.append(Finding('clock_drift', '', 0.0, 0.0, text))
    if limit.offset_s and abs(clock.offset_s) > CLOCK_SHARE * limit.offset_s:
        text = (
            f'the clock of {clock.logger} is {clock.offset_s:+.3f} s off {clock.reference}, '
            f'at most {limit.offset_s:g} s expected'
        )
        findings.append(Finding('clock_disagreement', '', 0.0, 0.0, text))
    return findings
