"""Ask a running comparator for a diagnosis and show its progress and its answer.

What `ros2 action send_goal` would do, where that command is not installed, with the answer printed
as the command line prints it.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path
import sys
from typing import Any

import rclpy
from rclpy.action import ActionClient
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Future

from escalator_msgs.action import Diagnose
from escalator_twin.ros.diagnosing import ACTION

FOUND_WITHIN_S = 30.0


class Refused(Exception):  # noqa: N818
    """The comparator does not answer, or gives no diagnosis."""


def ask(goal: Diagnose.Goal, executor: SingleThreadedExecutor, node: Node) -> Diagnose.Result:
    """Send a goal; follow it to its end.

    Raises
    ------
    Refused
        Where there is no comparator, or it is diagnosing already, or cannot.
    """
    client = ActionClient(node, Diagnose, ACTION)
    if not client.wait_for_server(FOUND_WITHIN_S):
        raise Refused(f'{ACTION}: no comparator offers it within {FOUND_WITHIN_S:.0f} s')
    line = _Line()

    def waited(future: Future) -> Any:
        executor.spin_until_future_complete(future)
        return future.result()

    handle = waited(client.send_goal_async(goal, line.show))
    if not handle.accepted:
        raise Refused('the comparator refuses: another diagnosis is in progress')
    try:
        result: Diagnose.Result = waited(handle.get_result_async()).result
    except KeyboardInterrupt:
        waited(handle.cancel_goal_async())
        raise
    finally:
        line.end()
    if not result.success:
        raise Refused(result.message)
    return result


class _Line:
    """Progress on one line of a terminal, or on few lines of anything else."""

    def __init__(self) -> None:
        self._is_terminal = sys.stderr.isatty()
        self._told = -1

    def show(self, message: Any) -> None:
        feedback = message.feedback
        if self._is_terminal:
            print(f'\r\033[K{feedback.stage}', end='', file=sys.stderr, flush=True)
        elif int(4.0 * feedback.fraction) != self._told:
            self._told = int(4.0 * feedback.fraction)
            print(feedback.stage, file=sys.stderr, flush=True)

    def end(self) -> None:
        if self._is_terminal:
            print(file=sys.stderr)


def main(argv: Sequence[str] | None = None) -> int:
    """Ask; print what was found. 0: diagnosed, 1: not, 130: interrupted."""
    parser = argparse.ArgumentParser(prog='ask', description=__doc__)
    parser.add_argument('bags', nargs='*', metavar='BAG', help='recordings; what is compared now')
    parser.add_argument('--hand-over', action='store_true', help='the simulator takes it over')
    parser.add_argument('--json', metavar='FILE', help='where the JSON of diagnose goes')
    parser.add_argument('--extended', default='', metavar='YAML', help='the extended machine')
    parser.add_argument('--jobs', type=int, default=1)
    parser.add_argument('--seed', type=int, default=0)
    words = rclpy.utilities.remove_ros_args(argv if argv is not None else sys.argv)
    given = parser.parse_args(words[1:])
    goal = Diagnose.Goal(
        bags=[str(Path(bag).absolute()) for bag in given.bags],
        extended_machine=given.extended,
        jobs=given.jobs,
        seed=given.seed,
        hand_over=given.hand_over,
    )
    rclpy.init()
    node = rclpy.create_node('ask')
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    try:
        result = ask(goal, executor, node)
        if given.json:
            Path(given.json).write_text(result.json, encoding='utf-8')
        print(result.message)
    except Refused as refusal:
        print(f'ask: {refusal}', file=sys.stderr)
        return 1
    except (KeyboardInterrupt, ExternalShutdownException):
        return 130
    finally:
        executor.shutdown()
        node.destroy_node()
        rclpy.try_shutdown()
    return 0


if __name__ == '__main__':
    sys.exit(main())
