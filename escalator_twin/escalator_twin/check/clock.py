"""The loggers' clocks against each other, by what one recorder's clock says of both.

Each message carries its logger's stamp and the time at which the recorder took it. Stamp minus bag
time is the logger's clock minus the recorder's, less a latency. Its difference between two loggers
is free of the recorder's clock, and of the latency as far as that is the same for both.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, NamedTuple

import numpy as np

from escalator_twin.check.lines import bin_edges, binned, Clock, Line, line_of, rate_of
from escalator_twin.machine import Machine
from escalator_twin.signals import Nanoseconds, Recording, Signal

# Bag times that differ from the stamps by no more than this scatter were made from them: a
# recorder's latency scatters by a hundred times as much.
NO_LATENCY_S = 2e-6
# A bag time that departs by more than this from the stamps' course is a jump of the recorder's.
JUMP_S = 0.25
JUMP_SPAN = 50
# Median and this quantile of the latency give the same difference where both loggers' latency is
# alike; what they differ by is the estimate's systematic doubt.
EARLY = 0.9
QUANTILES = (0.5, EARLY)
NORMAL_95 = 1.96


@dataclass(frozen=True)
class ClockComparison:
    """One logger's clock minus another's, by bag time.

    ``offset_s`` and ``drift_ppm`` are at the start of the recording and its rate; ``None`` where
    they cannot be known, and then ``reason`` says why.
    """

    logger: str = ''
    reference: str = ''
    offset_s: float | None = None
    offset_low_s: float | None = None
    offset_high_s: float | None = None
    drift_ppm: float | None = None
    drift_low_ppm: float | None = None
    drift_high_ppm: float | None = None
    reason: str = ''
    remarks: tuple[str, ...] = field(default=())

    @property
    def is_known(self) -> bool:
        """Tell whether there is an estimate."""
        return self.offset_s is not None

    def document(self) -> dict[str, Any]:
        """Return the comparison as JSON holds it."""
        return asdict(self)


def compare_clocks(recording: Recording, machine: Machine) -> ClockComparison:
    """Compare the first logger that is not the reference with the reference.

    The reference is the one that the machine calls most exact.

    Returns
    -------
    ClockComparison
        95 % intervals; without an estimate where the recording cannot tell.
    """
    loggers = machine.instruments.loggers
    if len(loggers) < 2:
        return ClockComparison(reason='the machine has one logger: there is no other clock')
    reference = machine.instruments.reference_logger
    others = [name for name in loggers if name != reference]
    present = [name for name in others if signals_of(recording, machine, name)]
    logger = (present or others)[0]
    return compare_loggers(recording, machine, logger, reference)


def compare_loggers(
    recording: Recording, machine: Machine, logger: str, reference: str
) -> ClockComparison:
    """Compare the clocks of two loggers; see `compare_clocks`."""

    def unknown(reason: str) -> ClockComparison:
        return ClockComparison(logger, reference, reason=reason)

    found = {name: signals_of(recording, machine, name) for name in (logger, reference)}
    for name, signals in found.items():
        if not signals:
            return unknown(f'no messages of the logger {name}')
    origin = min(int(s.bag_ns.min()) for signals in found.values() for s in signals)
    clocks = {name: clock_of(signals, origin) for name, signals in found.items()}
    for name, clock in clocks.items():
        difference = clock.stamp_s - clock.bag_s
        if float(difference.max() - difference.min()) < NO_LATENCY_S:
            return unknown(f'bag time equals the stamps of the logger {name}, up to a constant')
    moving, fixed, remarks = without_jumps(clocks[logger], clocks[reference])
    fits = [_fit(moving, fixed, quantile) for quantile in QUANTILES]
    return comparison_of(logger, reference, fits, remarks)


def comparison_of(
    logger: str, reference: str, fits: Sequence[Line | None], remarks: Sequence[str]
) -> ClockComparison:
    """Return the comparison by lines through the medians and through the early stamps."""
    if fits[0] is None:
        reason = 'too few messages of both loggers side by side'
        return ClockComparison(logger, reference, reason=reason)
    fit, early = fits[0], fits[1] or fits[0]
    doubt_s = NORMAL_95 * fit.offset_error_s + abs(fit.offset_s - early.offset_s)
    doubt = NORMAL_95 * fit.drift_error + abs(fit.drift - early.drift)
    return ClockComparison(
        logger,
        reference,
        fit.offset_s,
        fit.offset_s - doubt_s,
        fit.offset_s + doubt_s,
        1e6 * fit.drift,
        1e6 * (fit.drift - doubt),
        1e6 * (fit.drift + doubt),
        remarks=tuple(remarks),
    )


def signals_of(recording: Recording, machine: Machine, logger: str) -> list[Signal]:
    """Return one signal a topic of a logger."""
    topics: dict[str, Signal] = {}
    for sensor in machine.instruments.sensors:
        signal = recording.signals.get(sensor.channel)
        if sensor.logger == logger and signal is not None and len(signal.values):
            topics.setdefault(sensor.topic, signal)
    return list(topics.values())


def clock_of(signals: list[Signal], origin: int) -> Clock:
    stamp: Nanoseconds = np.concatenate([s.stamp_ns for s in signals])
    bag: Nanoseconds = np.concatenate([s.bag_ns for s in signals])
    order = np.argsort(stamp, kind='stable')
    # differences before floats: nanoseconds since 1970 do not fit a double
    return Clock((stamp[order] - origin) / 1e9, (bag[order] - origin) / 1e9)


class _Jump(NamedTuple):
    """The bag time jumps by ``size_s`` at message ``n_before``, at ``at_s`` by the stamps."""

    n_before: int
    at_s: float
    size_s: float


def _jumps(clock: Clock) -> list[_Jump]:
    """Return where a logger sees the bag time jump."""
    ahead = clock.bag_s - clock.stamp_s
    arrival, forward = np.diff(clock.bag_s), np.diff(clock.stamp_s)
    found: list[_Jump] = []
    for i in np.flatnonzero((np.abs(arrival - forward) > JUMP_S) & (forward < JUMP_S)) + 1:
        if found and i - found[-1].n_before < JUMP_SPAN:
            continue  # several topics' messages, on either side of one jump
        before = float(np.median(ahead[max(0, i - JUMP_SPAN) : i]))
        after = float(np.median(ahead[i : i + JUMP_SPAN]))
        if abs(after - before) > JUMP_S:
            found.append(_Jump(int(i), float(clock.bag_s[i - 1]), after - before))
    return found


def without_jumps(a: Clock, b: Clock) -> tuple[Clock, Clock, list[str]]:
    """Undo the jumps that both loggers see: those are the recorder's."""
    seen = _jumps(b)
    remarks = []
    bag_a, bag_b = a.bag_s.copy(), b.bag_s.copy()
    for jump in _jumps(a):
        twins = [other for other in seen if _is_same(jump, other)]
        if twins:
            bag_a[jump.n_before :] -= jump.size_s
            bag_b[twins[0].n_before :] -= jump.size_s
            remarks.append(f'the bag time jumps by {jump.size_s:+.3f} s at {jump.at_s:.2f} s')
    return Clock(a.stamp_s, bag_a), Clock(b.stamp_s, bag_b), remarks


def _is_same(one: _Jump, other: _Jump) -> bool:
    return abs(one.size_s - other.size_s) < JUMP_S / 2 and abs(one.at_s - other.at_s) < 1.0


def _fit(moving: Clock, fixed: Clock, quantile: float) -> Line | None:
    """Fit a robust line to the difference of two clocks over time."""
    start = max(moving.bag_s.min(), fixed.bag_s.min())
    edges = bin_edges(float(start), float(min(moving.bag_s.max(), fixed.bag_s.max())))
    if edges is None:
        return None
    # a replay's bag time may run at another rate: taken out of both alike
    rate = rate_of(fixed)
    sides = [binned(clock, edges, quantile, rate) for clock in (moving, fixed)]
    return line_of(edges, sides[0], sides[1], rate, float(fixed.stamp_s.min()))
