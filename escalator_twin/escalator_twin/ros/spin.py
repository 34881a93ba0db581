"""Run a node: errors as one line, a clean end on SIGINT and SIGTERM."""

from collections.abc import Callable, Sequence
import signal
import sys
import threading

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions

from escalator_twin.errors import EscalatorError

OK, BAD_INPUT = 0, 2
LOOK_S = 0.1  # between two looks at whether the node has ended


class Program(Node):
    """What a node of this package has beside rclpy's interface."""

    def is_over(self) -> bool:
        """Tell whether the process may end; raise what made the node's work fail."""
        return False

    def close(self) -> None:
        """Stop threads and close files."""


def run(make_node: Callable[[], Program], name: str, args: Sequence[str] | None = None) -> int:
    """Make a node, run it until it is over or interrupted, and return the exit status.

    The signals are taken here and not by rclpy, which would end the context at once: threads may
    still publish, and files are closed, before it goes.

    Parameters
    ----------
    make_node : callable
        Returns a node.
    name : str
        Of the program, for error messages.
    args : sequence of str, optional
        By default the process's own.
    """
    stop = _stop_on_signals()
    try:
        rclpy.init(
            args=None if args is None else list(args),
            signal_handler_options=SignalHandlerOptions.NO,
        )
    except RuntimeError as error:  # what rcl makes of arguments that it does not understand
        return _complain(name, error)
    try:
        _live(make_node, stop)
    except EscalatorError as error:
        return _complain(name, error)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()
    return OK


def _live(make_node: Callable[[], Program], stop: threading.Event) -> None:
    """Make a node, run it to its end, and clear away."""
    node = make_node()
    try:
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        while rclpy.ok() and not stop.is_set() and not node.is_over():
            executor.spin_once(timeout_sec=LOOK_S)
    finally:
        node.close()
        node.destroy_node()


def _stop_on_signals() -> threading.Event:
    """Return an event that the first SIGINT or SIGTERM sets; a second one ends the process."""
    stop = threading.Event()

    def note(number: int, _: object) -> None:
        stop.set()
        signal.signal(number, signal.SIG_DFL)

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, note)
    return stop


def _complain(name: str, error: Exception) -> int:
    print(f'{name}: {" ".join(str(error).split())}', file=sys.stderr)
    return BAD_INPUT
