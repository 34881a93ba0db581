"""A comparison's session as a recording: measured, simulated and results in one bag."""

from collections.abc import Iterator
import queue
import threading

import numpy as np

from escalator_twin import bagfile
from escalator_twin.bagfile import Message
from escalator_twin.comparison.judge import Judgement
from escalator_twin.conversions import Path
from escalator_twin.machine import Machine
from escalator_twin.ros.layout import aligned_topic, write_layout
from escalator_twin.ros.outputs import Encoder, FRAME, NS

ALIGNED_TYPE = 'escalator_msgs/msg/AlignedSample'


class Session(threading.Thread):
    """Writes messages to a bag as they come; the bag is there once it is closed.

    Parameters
    ----------
    path : str
        Directory to make; a layout for Foxglove and Lichtblick is put beside it.
    machine : Machine

    Raises
    ------
    BagError
        Where something is there already.
    """

    def __init__(self, path: str, machine: Machine) -> None:
        super().__init__(name='session', daemon=True)
        self._target = bagfile.check_target(path)
        self._machine = machine
        self._queue: queue.SimpleQueue[Message | None] = queue.SimpleQueue()
        self.failure: BaseException | None = None
        self.start()

    def add(self, message: Message) -> None:
        """Have a message written."""
        self._queue.put(message)

    def run(self) -> None:
        """Write until closed."""
        try:
            bagfile.write(self._target, self._messages())
            write_layout(self._target, self._machine)
        except BaseException as failure:
            self.failure = failure

    def _messages(self) -> Iterator[Message]:
        while (message := self._queue.get()) is not None:
            yield message

    def close(self) -> None:
        """Finish the bag; raise what kept it from being written."""
        self._queue.put(None)
        self.join()
        if self.failure is not None:
            raise self.failure


def note_aligned(session: Session, judgement: Judgement, origin_ns: int, shift_ns: int) -> None:
    """Put every channel, measured beside simulated at the same place, into a session.

    Parameters
    ----------
    session : Session
    judgement : Judgement
    origin_ns : int
        Time zero of the reference clock.
    shift_ns : int
        The recorder's clock less the reference clock.
    """
    paths: tuple[Path, ...] = (('measured',), ('simulated',), ('travel',))
    for channel, aligned in judgement.channels.items():
        encoder = Encoder(ALIGNED_TYPE, {FRAME: channel}, paths)
        kept = aligned.valid
        stamps = origin_ns + np.rint(aligned.time_s[kept] * NS).astype(np.int64)
        measured, simulated = aligned.measured[kept], aligned.simulated[kept]
        values = [measured - measured.mean(), simulated - simulated.mean(), aligned.travel_m[kept]]
        messages = encoder.encode(stamps, np.column_stack(values))
        for stamp, data in zip(stamps.tolist(), messages, strict=True):
            session.add(Message(aligned_topic(channel), stamp + shift_ns, data, ALIGNED_TYPE))
