"""A simulated run as it is heard over DDS: from messages back to a trace, every loss counted."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from escalator_twin.bagfile.cdr import columns
from escalator_twin.bagfile.definitions import typestore_for
from escalator_twin.conversions import parse_path, STAMP
from escalator_twin.errors import RecordingError
from escalator_twin.machine import Machine
from escalator_twin.physics.rollout import Trace
from escalator_twin.ros.outputs import (
    has_header,
    NS,
    Output,
    outputs_of,
    POSITION,
    position_output,
)
from escalator_twin.signals import Floats, Nanoseconds


@dataclass
class Part:
    """What came of one topic.

    Attributes
    ----------
    raw : list of bytes
        Not yet decoded.
    rows : list of (n,) int64
        Indices of samples since the run's start.
    values : list of (n, k) float64
    n_received, next_row : int
        Messages that were decoded, and one more than the highest index among them.
    n_disordered : int
        Messages whose index was not above the one before.
    n_stale : int
        Messages before the run's first one: of another run.
    is_begun : bool
        Whether the run's first message has come.
    """

    output: Output
    raw: list[bytes] = field(default_factory=list)
    rows: list[Nanoseconds] = field(default_factory=list)
    values: list[Floats] = field(default_factory=list)
    n_received: int = 0
    next_row: int = 0
    n_disordered: int = 0
    n_stale: int = 0
    is_begun: bool = False

    @property
    def n_lost(self) -> int:
        """Samples that should have come before the last one that did."""
        return self.next_row - self.n_received


class HeardRun:
    """Collects a run's messages and makes a trace of them.

    Parameters
    ----------
    machine : Machine
    """

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        measured = [output for output in outputs_of(machine) if output.is_measured]
        self.parts = [Part(output) for output in [*measured, position_output(machine)]]
        kinds = {part.output.type for part in self.parts}
        self._types = typestore_for(kinds).fielddefs
        self._stamped = {kind for kind in kinds if has_header(kind)}
        self.epoch_ns, self.rate_hz = 0, 1.0
        self._first_row = 0

    def begin(self) -> None:
        """Forget what came before a new run."""
        self.parts = [Part(part.output) for part in self.parts]
        self._first_row = 0

    def set_time(self, epoch_ns: int, rate_hz: float) -> None:
        """Tell the run's first stamp and its rate."""
        self.epoch_ns, self.rate_hz = epoch_ns, rate_hz

    def take(self, number: int, message: bytes) -> None:
        """Keep a message of the topic with this number."""
        self.parts[number].raw.append(message)

    def decode(self) -> list[tuple[Output, Nanoseconds, list[bytes]]]:
        """Decode what has come; return what is of this run as (topic, stamps, messages)."""
        fresh = []
        for part in self.parts:
            n = len(part.raw)
            if n:
                messages = part.raw[:n]
                del part.raw[:n]
                stamps, skipped = self._decode(part, messages)
                fresh.append((part.output, stamps, messages[skipped:]))
        return fresh

    def _decode(self, part: Part, messages: list[bytes]) -> tuple[Nanoseconds, int]:
        """Take in messages; return stamps, and how many belonged to a run before this one."""
        size = len(messages[0])
        if any(len(message) != size for message in messages):
            raise RecordingError(f'{part.output.name}: messages of different simulators')
        rows = np.frombuffer(b''.join(messages), np.uint8).reshape(-1, size)
        texts = [text for sensor in part.output.sensors for text in sensor.fields]
        paths = [parse_path(text) for text in texts] or [POSITION]
        stamp = STAMP if part.output.type in self._stamped else ()
        found, is_read = columns(rows, part.output.type, self._types, [*stamp, *paths])
        if not is_read.all():
            raise RecordingError(f'{part.output.name}: messages that do not fit their type')
        if stamp:
            stamps = found[0].astype(np.int64) * NS + found[1].astype(np.int64)
            index = np.rint((stamps - self.epoch_ns) * (self.rate_hz / NS)).astype(np.int64)
        else:
            index = part.next_row + np.arange(len(rows))
            stamps = self.epoch_ns + np.rint(index * (NS / self.rate_hz)).astype(np.int64)
        skipped = 0
        if not part.is_begun:
            first = np.flatnonzero(index == 0)
            skipped = int(first[-1]) if len(first) else len(index)
            part.n_stale += skipped
            part.is_begun = len(first) > 0
        values = _values(part.output, found[len(stamp) :])
        self._keep(part, index[skipped:], values[skipped:])
        return stamps[skipped:], skipped

    def _keep(self, part: Part, index: Nanoseconds, values: Floats) -> None:
        if not len(index):
            return
        before = np.concatenate([[part.next_row - 1], index[:-1]])
        part.n_disordered += int((index <= before).sum())
        part.n_received += len(index)
        part.next_row = max(part.next_row, int(index.max()) + 1)
        part.rows.append(index)
        part.values.append(values)

    @property
    def is_begun(self) -> bool:
        """Tell whether every topic's first message has come."""
        return all(part.is_begun for part in self.parts)

    @property
    def is_cut(self) -> bool:
        """Tell whether some topic goes on without its beginning having come."""
        return any(p.n_stale and not p.is_begun for p in self.parts) and any(
            p.is_begun for p in self.parts
        )

    @property
    def n_rows(self) -> int:
        """How many samples all topics have."""
        return min(part.next_row for part in self.parts)

    @property
    def n_lost(self) -> int:
        """Messages that did not come."""
        return sum(part.n_lost for part in self.parts)

    @property
    def n_disordered(self) -> int:
        """Messages that came behind a later one."""
        return sum(part.n_disordered for part in self.parts)

    @property
    def n_received(self) -> int:
        """Messages that came."""
        return sum(part.n_received for part in self.parts)

    def forget(self, before_s: float) -> None:
        """Drop what came before a time since the start."""
        self._first_row = max(self._first_row, int(before_s * self.rate_hz))
        for part in self.parts:
            while part.rows and part.rows[0][-1] < self._first_row:
                del part.rows[0], part.values[0]

    def trace(self, length_m: float) -> Trace:
        """Return what all topics have so far and is not forgotten, lost samples interpolated.

        Parameters
        ----------
        length_m : float
            Of the closed path.
        """
        first, n = self._first_row, self.n_rows - self._first_row
        sensors = self.machine.instruments.sensors
        table = np.full((n, len(sensors)), np.nan)
        place = np.zeros(n)
        for part in self.parts:
            rows = np.concatenate(part.rows) - first
            inside = (rows >= 0) & (rows < n)
            rows, values = rows[inside], np.concatenate(part.values)[inside]
            if part.output.sensors:
                for k, column in enumerate(part.output.columns):
                    table[rows, column] = values[:, k]
                continue
            order = np.argsort(rows, kind='stable')
            way = np.unwrap(values[order, 0], period=length_m)
            place = np.interp(np.arange(n), rows[order], way)
        return Trace((first + np.arange(n)) / self.rate_hz, _filled(table), place)


def _values(output: Output, found: list[Any]) -> Floats:
    """Return a topic's sensors in SI from its messages' fields: (n, sensors)."""
    if not output.sensors:
        return np.asarray(found[0], dtype=np.float64)[:, None]
    result, first = [], 0
    for sensor in output.sensors:
        fields = np.column_stack(found[first : first + len(sensor.fields)])
        result.append((sensor.sign * sensor.scale * fields + sensor.offset).mean(axis=1))
        first += len(sensor.fields)
    return np.column_stack(result)


def _filled(table: Floats) -> Floats:
    """Return a table with its gaps interpolated column by column."""
    for column in table.T:
        gaps = np.isnan(column)
        if gaps.any() and not gaps.all():
            there = np.flatnonzero(~gaps)
            column[gaps] = np.interp(np.flatnonzero(gaps), there, column[there])
    return table
