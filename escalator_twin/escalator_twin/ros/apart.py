"""A diagnosis in a process of its own: it takes minutes, and the comparison goes on meanwhile.

No ROS here: the process gives the function that it runs, which is the command line's.
"""

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
import multiprocessing
from multiprocessing.connection import Connection
import os
import signal
import threading
from typing import Any

from escalator_twin.cli.output import dumps
from escalator_twin.errors import EscalatorError

Diagnose = Callable[..., Mapping[str, Any]]
LOOK_S = 0.1  # between two looks at whether it is cancelled
PROGRESS, DOCUMENT, REFUSED = 'progress', 'document', 'refused'


class Cancelled(Exception):  # noqa: N818
    """Nobody wants the diagnosis any more; no error."""


@dataclass(frozen=True)
class Request:
    """What is to be diagnosed; the arguments of `pipeline.diagnose`."""

    paths: list[str]
    machine_path: str
    seed: int
    jobs: int
    out: str


class Apart:
    """Runs a diagnosis in another process, which ends when it is cancelled.

    Parameters
    ----------
    function : callable
        `pipeline.diagnose`, or what takes its place; another process must be able to import it.
    request : Request
    """

    def __init__(self, function: Diagnose, request: Request) -> None:
        self._is_cancelled = threading.Event()
        # a copy of this process would hold copies of DDS's threads and locks
        context = multiprocessing.get_context('spawn')
        self._heard, told = context.Pipe(duplex=False)
        # no daemon: those may not have helpers of their own
        self._process = context.Process(target=_work, args=(told, function, request))
        self._process.start()
        told.close()

    def cancel(self) -> None:
        """Have it ended."""
        self._is_cancelled.set()

    def follow(self, tell: Callable[[float], None]) -> str:
        """Wait for the end; return the document as JSON.

        Parameters
        ----------
        tell : callable
            Gets the share that is done.

        Raises
        ------
        Cancelled
            Where that was wanted.
        EscalatorError
            Where the input cannot be diagnosed, or the process has ended without a result.
        """
        try:
            while True:
                if self._is_cancelled.is_set():
                    raise Cancelled
                if not self._heard.poll(LOOK_S):
                    continue
                kind, value = self._heard.recv()
                if kind == DOCUMENT:
                    return str(value)
                if kind == REFUSED:
                    raise EscalatorError(str(value))
                tell(float(value))
        except EOFError:
            self._process.join()
            raise EscalatorError(
                f'the diagnosis has ended with status {self._process.exitcode}'
            ) from None
        finally:
            self._end()

    def _end(self) -> None:
        """End the process with its helpers."""
        pid = self._process.pid
        if self._process.is_alive() and pid is not None:
            with suppress(ProcessLookupError):
                # until it has a group of its own it has no helpers either
                if os.getpgid(pid) == pid:
                    os.killpg(pid, signal.SIGKILL)
                else:
                    os.kill(pid, signal.SIGKILL)
        self._process.join()
        self._heard.close()


def _work(told: Connection, function: Diagnose, request: Request) -> None:
    """Do the diagnosis; the target of the process."""
    os.setpgid(0, 0)

    def progress(done: float, total: float) -> None:
        try:
            told.send((PROGRESS, done / total))
        except OSError:  # who asked for it is gone
            os.killpg(0, signal.SIGKILL)

    try:
        document = function(
            paths=request.paths,
            machine_path=request.machine_path,
            seed=request.seed,
            jobs=request.jobs,
            progress=progress,
            out=request.out,
        )
        told.send((DOCUMENT, dumps(document)))
    except EscalatorError as error:
        told.send((REFUSED, ' '.join(str(error).split())))
