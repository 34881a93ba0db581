"""One piece of work beside the executor."""

from collections.abc import Callable
import threading

CLOSING_S = 3.0  # that closing waits: a search or an equilibrium cannot be interrupted


class Stopped(Exception):  # noqa: N818
    """The node is to end; no error."""


class Worker(threading.Thread):
    """Runs a function once and keeps what made it fail.

    Parameters
    ----------
    work : callable
        May raise `Stopped`.
    name : str
    """

    def __init__(self, work: Callable[[], None], name: str) -> None:
        super().__init__(name=name, daemon=True)
        self._work = work
        self._failure: BaseException | None = None

    def run(self) -> None:
        """Do the work."""
        try:
            self._work()
        except Stopped:
            pass
        except BaseException as failure:
            self._failure = failure

    def is_done(self) -> bool:
        """Tell whether the work has ended; raise what made it fail."""
        if self.is_alive():
            return False
        if self._failure is not None:
            raise self._failure
        return True

    def close(self) -> None:
        """Wait a little for the end."""
        self.join(CLOSING_S)
