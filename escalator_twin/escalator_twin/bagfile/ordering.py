"""Serialised messages of a bag in the order of bag time, in bounded memory."""

from collections.abc import Iterable, Iterator
import os
from typing import NamedTuple

import numpy as np

from escalator_twin.bagfile.source import Bag


class Message(NamedTuple):
    """One serialised message (CDR)."""

    topic: str
    bag_ns: int
    data: bytes
    type: str


def messages(
    path: str | os.PathLike[str], topics: Iterable[str] | None = None
) -> Iterator[Message]:
    """Yield a bag's messages in the order of bag time; equal times in the file's order.

    The bag is gone through twice: once for the times, so that no more than what overlaps is held.

    Parameters
    ----------
    path : path
        A rosbag2 directory, or one of its files.
    topics : iterable of str, optional
        All by default.

    Raises
    ------
    BagError
        Where the container cannot be read.
    """
    wanted = None if topics is None else set(topics)
    with Bag(path) as bag:
        first = [int(b.bag_ns.min()) for _, b in bag.blocks(wanted) if len(b.bag_ns)]
        # earliest time in any block behind this one
        behind = np.minimum.accumulate(np.array([*first, np.iinfo(np.int64).max])[::-1])[::-1]
        held: list[Message] = []
        i = 0
        for file, block in bag.blocks(wanted):
            if not len(block.bag_ns):
                continue
            for channel, time, start, size in zip(
                block.channel.tolist(),
                block.bag_ns.tolist(),
                block.start.tolist(),
                block.size.tolist(),
                strict=True,
            ):
                info = file.channels[channel]
                if wanted is None or info.topic in wanted:
                    data = block.data[start : start + size]
                    held.append(Message(info.topic, time, data, info.type))
            i += 1
            limit = int(behind[i])
            held.sort(key=_time)
            n = sum(message.bag_ns <= limit for message in held)
            yield from held[:n]
            del held[:n]


def _time(message: Message) -> int:
    return message.bag_ns
