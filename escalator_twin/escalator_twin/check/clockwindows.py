"""The loggers' clocks over a long recording, window by window: bins are all that is kept."""

from collections.abc import Mapping

import numpy as np

from escalator_twin.check.clock import (
    clock_of,
    ClockComparison,
    comparison_of,
    NO_LATENCY_S,
    QUANTILES,
    signals_of,
    without_jumps,
)
from escalator_twin.check.lines import bin_edges, binned, Clock, line_of, rate_of
from escalator_twin.machine import Machine
from escalator_twin.signals import Floats, Recording


class ClockSurvey:
    """What `compare_clocks` finds, gathered from one window after the other.

    Parameters
    ----------
    machine : Machine
    spans : mapping of logger to (int, int)
        First and last bag time of those that have messages, ns.
    """

    def __init__(self, machine: Machine, spans: Mapping[str, tuple[int, int]]) -> None:
        self.machine = machine
        self.reason = ''
        self.origin = min((first for first, _ in spans.values()), default=0)
        instruments = machine.instruments
        self.reference = instruments.reference_logger
        others = [name for name in instruments.loggers if name != self.reference]
        self.logger = next((name for name in others if name in spans), next(iter(others), ''))
        self.pair = (self.logger, self.reference)
        self.edges: Floats | None = None
        if not others:
            self.reason = 'the machine has one logger: there is no other clock'
        elif absent := [name for name in self.pair if name not in spans]:
            self.reason = f'no messages of the logger {absent[0]}'
        else:
            start, end = max(spans[n][0] for n in self.pair), min(spans[n][1] for n in self.pair)
            self.edges = bin_edges((start - self.origin) / 1e9, (end - self.origin) / 1e9)
        n_bins = 0 if self.edges is None else len(self.edges) - 1
        self._bins = np.full((2, len(QUANTILES), n_bins), np.nan)
        self._rate: float | None = None
        self._first = 0.0
        self._undone = [0.0, 0.0]  # jumps of bag time, s
        self._spread = [(np.inf, -np.inf), (np.inf, -np.inf)]
        self._remarks: list[str] = []

    def add(self, recording: Recording) -> None:
        """Take the next window."""
        signals = [signals_of(recording, self.machine, name) for name in self.pair]
        if self.edges is None or not all(signals):
            return
        clocks = []
        for i, members in enumerate(signals):
            clock = clock_of(members, self.origin)
            ahead = clock.stamp_s - clock.bag_s
            low, high = self._spread[i]
            self._spread[i] = (min(low, float(ahead.min())), max(high, float(ahead.max())))
            clocks.append(Clock(clock.stamp_s, clock.bag_s - self._undone[i]))
        moving, fixed, remarks = without_jumps(clocks[0], clocks[1])
        self._remarks += remarks
        if self._rate is None:
            self._rate, self._first = rate_of(fixed), float(fixed.stamp_s.min())
        for i, clock in enumerate((moving, fixed)):
            self._undone[i] += float(clocks[i].bag_s[-1] - clock.bag_s[-1])
            for k, quantile in enumerate(QUANTILES):
                new = binned(clock, self.edges, quantile, self._rate)
                self._bins[i, k] = np.where(np.isnan(self._bins[i, k]), new, self._bins[i, k])

    def comparison(self) -> ClockComparison:
        """Return the comparison over all windows."""
        if self.reason:
            return ClockComparison(self.logger, self.reference, reason=self.reason)
        for name, (low, high) in zip(self.pair, self._spread, strict=True):
            if high - low < NO_LATENCY_S:
                reason = f'bag time equals the stamps of the logger {name}, up to a constant'
                return ClockComparison(self.logger, self.reference, reason=reason)
        if self.edges is None or self._rate is None:
            return comparison_of(self.logger, self.reference, [None, None], self._remarks)
        fits = [
            line_of(self.edges, self._bins[0, k], self._bins[1, k], self._rate, self._first)
            for k in range(len(QUANTILES))
        ]
        return comparison_of(self.logger, self.reference, fits, self._remarks)
