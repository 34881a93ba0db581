"""Creep of gauges that shows without a model: one loop against the next, link against link."""

from collections.abc import Container, Mapping

import numpy as np

from escalator_twin.machine import Machine, Sensor
from escalator_twin.signals import Experiment, Finding, Floats, Recording, Signal

QUANTITY = 'link_force'
GRID_HZ = 10.0  # means over a tenth of a second
BIN_NS = 100_000_000
MOST_EMPTY = 100_000  # bins without samples that are held
# A link's creep counts beyond this many times the thermal drift that its gauges may have: 5e-6
# strain of the prototype's, twice and a half its 2e-6, half of the creep that matters.
THERMAL = 2.5
# The shortest overlap of one loop with the next, in loops, that a mean is taken over.
MIN_OVERLAP = 0.2
# How far a loop's duration may be off what the set speed says.
SPEED_SHARE = 0.12


class Course:
    """One channel's means over tenths of a second, gathered part by part."""

    def __init__(self, signal: Signal) -> None:
        self.first_ns = self.last_ns = int(signal.stamp_ns[0])
        self.n = 0
        self.is_broken = False
        self._sums: list[tuple[int, Floats, Floats]] = []
        self.add(signal)

    def add(self, signal: Signal) -> None:
        """Take the next samples."""
        if not len(signal.values):
            return
        bins = (signal.stamp_ns - self.first_ns) // BIN_NS
        low = int(bins[0])
        self.n += len(signal.values)
        self.last_ns = int(signal.stamp_ns[-1])
        if low < 0 or int(bins[-1]) - low > 10 * len(bins) + MOST_EMPTY:
            self.is_broken = True  # stamps all over the years
        if self.is_broken:
            return
        counts = np.bincount(bins - low).astype(np.float64)
        sums = np.bincount(bins - low, signal.values).astype(np.float64)
        self._sums.append((low, sums, counts))

    @property
    def span_s(self) -> float:
        """Length of the channel, s."""
        return (self.last_ns - self.first_ns) / 1e9

    def means(self) -> Floats:
        """Return the means of all whole tenths of a second; NaN where there is no sample."""
        n_bins = max(low + len(counts) for low, _, counts in self._sums)
        total, number = np.zeros((2, n_bins))
        for low, sums, counts in self._sums:
            total[low : low + len(sums)] += sums
            number[low : low + len(counts)] += counts
        with np.errstate(invalid='ignore', divide='ignore'):
            return (total / number)[:-1]


def is_followed(sensor: Sensor) -> bool:
    """Tell whether a channel's creep is looked for."""
    return bool(sensor.quantity == QUANTITY and sensor.thermal_drift)


def drifts(recording: Recording, machine: Machine, faulty: Container[str] = ()) -> list[Finding]:
    """Find links that creep away from the others between two passages of the same places.

    A loop's duration is where a link's force repeats best; the median difference of the two
    passages, over the time between them, is the creep's rate.

    Parameters
    ----------
    recording : Recording
        Its experiment tells about how long a loop takes.
    machine : Machine
        Describes the links' gauges.
    faulty : container of str
        Channels with another fault: these are left out.
    """
    courses = {
        s.channel: Course(recording.signals[s.channel])
        for s in machine.instruments.sensors
        if is_followed(s) and s.channel in recording.signals
    }
    return judge_courses(courses, recording.experiment, machine, faulty)


def judge_courses(
    courses: Mapping[str, Course],
    experiment: Experiment | None,
    machine: Machine,
    faulty: Container[str] = (),
) -> list[Finding]:
    """Find links whose course creeps away from the others'; see `drifts`."""
    sensors = [
        s for s in machine.instruments.sensors if s.channel in courses and s.channel not in faulty
    ]
    if len(sensors) < 3 or experiment is None:
        return []  # nothing to stand out from, or no idea of a loop's duration
    length = machine.chain.n_links * machine.chain.pitch_m
    expected = length / experiment.set_speed_m_s
    creep = {}
    for sensor in sensors:
        value = _creep(courses[sensor.channel], expected)
        if value is None:
            return []
        creep[sensor.channel] = value / abs(sensor.scale)
    return _standing_out(sensors, creep, courses)


def _standing_out(
    sensors: list[Sensor], creep: dict[str, float], courses: Mapping[str, Course]
) -> list[Finding]:
    findings = []
    for sensor in sensors:
        others = [value for name, value in creep.items() if name != sensor.channel]
        excess = creep[sensor.channel] - float(np.median(others))
        if abs(excess) > THERMAL * sensor.thermal_drift:
            text = (
                f'creeps by {excess:+.2g} (mean of the fields) over the recording '
                f'against the other links'
            )
            end_s = courses[sensor.channel].span_s
            findings.append(Finding('gauge_drift', sensor.channel, 0.0, end_s, text))
    return findings


def _creep(course: Course, expected_s: float) -> float | None:
    """Return how much a signal changes over the recording, place by place; ``None``: unknown."""
    if course.is_broken or course.span_s * GRID_HZ > course.n:
        return None  # mostly gaps
    values = course.means()
    if len(values) + 1 < (1.0 + MIN_OVERLAP) * expected_s * GRID_HZ:
        return None
    if not np.isfinite(values).all():
        return None  # a gap: no passage to compare
    lag = _loop_lag(values, expected_s)
    if lag is None:
        return None
    difference = values[lag:] - values[:-lag]
    return float(np.median(difference)) * len(values) / lag


def _loop_lag(values: Floats, expected_s: float) -> int | None:
    """Return the number of samples after which a signal repeats best."""
    low, high = (
        int(expected_s * GRID_HZ * share) for share in (1.0 - SPEED_SHARE, 1.0 + SPEED_SHARE)
    )
    high = min(high, int(len(values) / (1.0 + MIN_OVERLAP)))
    lags = range(low, high + 1)
    if len(lags) < 3:
        return None
    misfit = [float(np.std(values[lag:] - values[:-lag])) for lag in lags]
    return lags[int(np.argmin(misfit))]
