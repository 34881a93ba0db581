"""A comparison's session as a recording: measured, simulated and results in one bag."""

from collections.abc import Iterator
import queue
import threading

from escalator_twin import bagfile
from escalator_twin.bagfile import Message


class Session(threading.Thread):
    """Writes messages to a bag as they come; the bag is there once it is closed.

    Parameters
    ----------
    path : str
        Directory to make.

    Raises
    ------
    BagError
        Where something is there already.
    """

    def __init__(self, path: str) -> None:
        super().__init__(name='session', daemon=True)
        self._target = bagfile.check_target(path)
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
