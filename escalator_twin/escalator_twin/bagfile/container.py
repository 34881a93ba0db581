"""What every kind of storage file hands out, and its limits."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

# Largest chunk, schema or message that is believed, bytes: beyond any recorder's, below memory.
MAX_CHUNK = 1 << 30
MAX_SCHEMA = 1 << 20

Bytes = NDArray[np.uint8]
Indices = NDArray[np.int64]


# Latest time that is believed, ns: the year 2096, whose differences still fit.
MAX_TIME = 4 * 10**18


def bag_times(raw: ArrayLike) -> Indices:
    """Return log times as whole nanoseconds whose differences do not overflow."""
    return np.clip(np.asarray(raw, dtype=np.int64), 0, MAX_TIME)


class Span(NamedTuple):
    """A window of bag time, [from_ns, to_ns)."""

    from_ns: int = 0
    to_ns: int = MAX_TIME + 1

    def holds(self, times: Indices) -> NDArray[np.bool_]:
        """Tell which times lie inside."""
        return np.asarray((times >= self.from_ns) & (times < self.to_ns))

    def meets(self, first_ns: int, last_ns: int) -> bool:
        """Tell whether any time from ``first_ns`` to ``last_ns`` can lie inside."""
        return first_ns < self.to_ns and last_ns >= self.from_ns

    def widened(self, margin_ns: int) -> 'Span':
        """Return the window with a margin on either side."""
        return Span(max(self.from_ns - margin_ns, 0), min(self.to_ns + margin_ns, MAX_TIME + 1))


ALWAYS = Span()


class Channel(NamedTuple):
    """One topic of one file, with the definition of its type as the file gives it."""

    topic: str
    type: str
    serialization: str
    schema_encoding: str
    schema: str


class Count(NamedTuple):
    """Messages of one channel: how many, and the first and last bag time (ns)."""

    n: int
    first_ns: int
    last_ns: int

    def __add__(self, other: 'Count') -> 'Count':  # type: ignore[override]
        """Join two counts of one channel."""
        if not self.n or not other.n:
            return self if self.n else other
        return Count(
            self.n + other.n,
            min(self.first_ns, other.first_ns),
            max(self.last_ns, other.last_ns),
        )


NOTHING = Count(0, 0, 0)


@dataclass(frozen=True, slots=True)
class Block:
    """Some messages of one file, in the file's order.

    Attributes
    ----------
    data : bytes
        Holds the messages; one decompressed chunk, say.
    channel : (n,) int64
        Index into the file's ``channels``.
    bag_ns : (n,) int64
        Log time.
    start, size : (n,) int64
        Where in ``data`` each serialised message lies.
    """

    data: bytes
    channel: Indices
    bag_ns: Indices
    start: Indices
    size: Indices


def count_blocks(blocks: Iterable[Block]) -> dict[int, Count]:
    """Count messages by reading them."""
    found: dict[int, Count] = {}
    for block in blocks:
        for index in np.unique(block.channel):
            times = block.bag_ns[block.channel == index]
            count = Count(len(times), int(times.min()), int(times.max()))
            found[int(index)] = found.get(int(index), NOTHING) + count
    return found


@dataclass
class Damage:
    """What is odd about a file, in words for the user; filled while reading.

    ``losses`` cost messages, ``remarks`` do not.
    """

    losses: list[str] = field(default_factory=list)
    remarks: list[str] = field(default_factory=list)

    def add(self, loss: str) -> None:
        """Keep a loss once, and at most twenty of them."""
        if loss not in self.losses and len(self.losses) < 20:
            self.losses.append(loss)

    def remark(self, text: str) -> None:
        """Keep a remark once."""
        if text not in self.remarks and len(self.remarks) < 20:
            self.remarks.append(text)


class StorageFile(Protocol):
    """One file of a bag."""

    channels: list[Channel]
    damage: Damage

    def blocks(self, topics: set[str] | None, span: Span = ALWAYS) -> Iterator[Block]:
        """Yield the messages of ``topics`` (``None``: all), skipping the rest unread.

        What lies outside ``span`` is skipped as far as the file tells; some of it may be given.
        """
        ...

    def counts(self) -> dict[int, Count]:
        """Return how many messages each channel has, reading as little as possible."""
        ...

    def close(self) -> None:
        """Close the file."""
        ...
