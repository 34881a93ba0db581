"""Measured messages as the loggers send them."""

from collections import deque
from collections.abc import Callable
import struct
import threading
import time

from escalator_twin.bagfile import Message
from escalator_twin.machine import Machine
from escalator_twin.ros.inbox import Source
from escalator_twin.ros.outputs import (
    has_header,
    measured_name,
    measured_topics,
    message_class,
    NS,
)

BYTE_ORDER = {b'\x00\x00': '>', b'\x00\x01': '<'}  # of CDR


class Stream:
    """Measured messages as they come, the oldest dropped.

    Parameters
    ----------
    machine : Machine
    keep_s : float
    note : callable
        Gets each message.
    """

    def __init__(
        self, machine: Machine, keep_s: float, note: Callable[[list[Message]], None]
    ) -> None:
        self.machine, self._keep_ns, self._note = machine, round(keep_s * NS), note
        self._messages: deque[Message] = deque()
        self._once: dict[str, Message] = {}
        self._first_ns: dict[str, int] = {}
        self._last_ns: dict[str, int] = {}
        self._lock = threading.Lock()
        self.last_wall = 0.0
        instruments = machine.instruments
        self._types = {s.topic: s.type for s in instruments.sensors}
        if instruments.experiment is not None:
            self._types[instruments.experiment.topic] = instruments.experiment.type

    def sources(self) -> list[Source]:
        """Return the topics to listen to."""
        return [
            Source(
                measured_name(self.machine, topic),
                message_class(self._types[topic], topic),
                self._taker(topic),
            )
            for topic in measured_topics(self.machine)
        ]

    def _taker(self, topic: str) -> Callable[[bytes, int], None]:
        instruments = self.machine.instruments
        name, kind = instruments.measured_topic(topic), self._types[topic]
        has_stamp = has_header(kind)
        is_once = instruments.experiment is not None and topic == instruments.experiment.topic

        def take(data: bytes, arrival_ns: int) -> None:
            message = Message(name, arrival_ns, data, kind)
            with self._lock:
                if is_once:
                    self._once[name] = message
                else:
                    self._messages.append(message)
                    time_ns = stamp_of(data) if has_stamp else arrival_ns
                    self._first_ns.setdefault(name, time_ns)
                    self._last_ns[name] = time_ns
                self.last_wall = time.monotonic()
                kept = self._messages
                while kept and arrival_ns - kept[0].bag_ns > self._keep_ns:
                    kept.popleft()
            self._note([message])

        return take

    def forget(self) -> None:
        """Drop everything: another stream begins."""
        with self._lock:
            self._messages.clear()
            self._first_ns.clear()
            self._last_ns.clear()
        self.last_wall = 0.0

    def messages(self, last_s: float | None = None) -> list[Message]:
        """Return what is kept, or the last seconds of it; the experiment's message first."""
        with self._lock:
            kept, once = list(self._messages), list(self._once.values())
        if last_s is not None and kept:
            limit = kept[-1].bag_ns - round(last_s * NS)
            kept = [message for message in kept if message.bag_ns >= limit]
        first = kept[0].bag_ns if kept else 0
        return [message._replace(bag_ns=min(message.bag_ns, first)) for message in once] + kept

    @property
    def span_s(self) -> float:
        """Time by the stamps since the stream began."""
        with self._lock:
            spans = [last - self._first_ns[name] for name, last in self._last_ns.items()]
            return max(spans, default=0) / NS

    @property
    def silence_s(self) -> float:
        """Wall time since the last message."""
        return time.monotonic() - self.last_wall if self.last_wall else 0.0


def stamp_of(data: bytes) -> int:
    """Return the stamp of a serialised message that begins with a header, ns."""
    seconds, nanoseconds = struct.unpack_from(BYTE_ORDER[data[:2]] + 'iI', data, 4)
    return int(seconds) * NS + int(nanoseconds)
