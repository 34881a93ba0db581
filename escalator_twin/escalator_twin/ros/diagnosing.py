"""The comparator's action: diagnose what is compared, tell it, hand the simulator the result."""

from collections.abc import Callable
import json
from pathlib import Path
import tempfile
import threading
import traceback

from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle as Handle
from rclpy.node import Node
from rclpy.serialization import serialize_message

from escalator_msgs.action import Diagnose
from escalator_msgs.msg import Diagnosis
from escalator_twin import bagfile
from escalator_twin.bagfile import Message
from escalator_twin.cli.diagnose import show
from escalator_twin.errors import EscalatorError
from escalator_twin.ros import qos
from escalator_twin.ros.apart import Apart, Cancelled, Request
from escalator_twin.ros.apart import Diagnose as Function
from escalator_twin.ros.comparing import Comparing
from escalator_twin.ros.results import diagnosis_message
from escalator_twin.ros.worker import CLOSING_S, Stopped

ACTION = 'comparator/diagnose'
TOPIC = 'comparator/diagnosis'
DIAGNOSIS_TYPE = 'escalator_msgs/msg/Diagnosis'
Finish = Callable[[Handle], None]


class Diagnosing:
    """Serves the action, one goal at a time, beside everything else.

    Parameters
    ----------
    node : Node
    comparing : Comparing
    function : callable
        `pipeline.diagnose`, so that live and offline agree.
    heard : callable
        Returns the messages that are listened to; none in a replay.
    """

    def __init__(
        self,
        node: Node,
        comparing: Comparing,
        function: Function,
        heard: Callable[[], list[Message]],
    ) -> None:
        self._node, self._comparing, self._function = node, comparing, function
        self._heard = heard
        self.state = 'not asked for'
        self._lock = threading.Lock()
        self._is_busy = self._is_closing = False
        self._apart: Apart | None = None
        self._thread: threading.Thread | None = None
        self._publisher = node.create_publisher(Diagnosis, TOPIC, qos.LATCHED)
        self._server = ActionServer(
            node,
            Diagnose,
            ACTION,
            execute_callback=self._never,
            goal_callback=self._on_goal,
            handle_accepted_callback=self._on_accepted,
            cancel_callback=self._on_cancel,
        )

    def close(self) -> None:
        """End a diagnosis that goes on."""
        with self._lock:
            self._is_closing = True
            if self._apart is not None:
                self._apart.cancel()
        if self._thread is not None:
            self._thread.join(CLOSING_S)
        self._server.destroy()

    # in the executor's thread

    def _on_goal(self, _: Diagnose.Goal) -> GoalResponse:
        with self._lock:
            if self._is_busy or self._is_closing:
                self._node.get_logger().warning('a diagnosis is in progress: another is refused')
                return GoalResponse.REJECT
            self._is_busy = True
        return GoalResponse.ACCEPT

    def _on_accepted(self, handle: Handle) -> None:
        # an executor waits for a callback, and asks one that awaits without pause
        self._thread = threading.Thread(
            target=self._work, args=(handle,), name='diagnosis', daemon=True
        )
        self._thread.start()

    def _on_cancel(self, _: Handle) -> CancelResponse:
        with self._lock:
            if self._apart is None:
                return CancelResponse.REJECT
            self._apart.cancel()
        return CancelResponse.ACCEPT

    def _never(self, _: Handle) -> Diagnose.Result:
        raise AssertionError('goals are finished with a function of their own')

    # in the diagnosis's thread

    def _work(self, handle: Handle) -> None:
        """Do what a goal asks for, and have the executor send the result."""
        finish: Finish
        try:
            result = self._diagnosed(handle)
            finish = _succeed if result.success else _abort
            self._say('diagnosed' if result.success else result.message)
        except (Cancelled, Stopped):
            result = Diagnose.Result(message='cancelled')
            finish = _cancel
            self._say('the diagnosis was cancelled')
        except EscalatorError as error:
            result = Diagnose.Result(message=str(error))
            finish = _abort
            self._say(f'not diagnosed: {error}')
        except Exception as failure:
            # who has asked is told, and the comparison goes on
            result = Diagnose.Result(message=f'{type(failure).__name__}: {failure}')
            finish = _abort
            self._node.get_logger().error(traceback.format_exc())
        finally:
            with self._lock:
                self._apart, self._is_busy = None, False
        if not self._is_closing:
            handle.execute(lambda goal: _finished(goal, finish, result))

    def _say(self, text: str) -> None:
        self.state = text
        self._node.get_logger().info(text)

    def _diagnosed(self, handle: Handle) -> Diagnose.Result:
        """Return the result of a goal."""
        goal = handle.request
        with tempfile.TemporaryDirectory(prefix='escalator-twin-') as folder:
            paths = self._paths(goal, Path(folder))
            out = self._target(goal)
            self._say(f'diagnosing {", ".join(paths)}')
            request = Request(
                paths,
                str(self._comparing.machine.source),
                int(goal.seed),
                max(1, int(goal.jobs)),
                str(out),
            )
            text = self._followed(handle, request)
        document = json.loads(text)
        message = diagnosis_message(document)
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(message)
        self._comparing.note_result(TOPIC, serialize_message(message), DIAGNOSIS_TYPE)
        result = Diagnose.Result(
            success=True,
            message=show(document).strip(),
            json=text,
            extended_machine=document['extended_machine'],
        )
        if goal.hand_over:
            self._feed_back(handle, 'the simulator takes the extended machine over', 1.0)
            try:
                self._comparing.hand_over(str(out))
            except EscalatorError as error:
                result.success, result.message = False, f'not handed over: {error}'
        return result

    def _followed(self, handle: Handle, request: Request) -> str:
        """Run the diagnosis and return its JSON."""
        with self._lock:
            if self._is_closing or handle.is_cancel_requested:
                raise Cancelled
            self._apart = apart = Apart(self._function, request)
        n = len(request.paths)
        self._feed_back(handle, 'starting', 0.0)

        def tell(share: float) -> None:
            done = f'{round(share * n)} of {n} recordings are' if n > 1 else f'{share:.0%} is'
            self._feed_back(handle, f'{done} diagnosed', share)

        return apart.follow(tell)

    def _feed_back(self, handle: Handle, stage: str, fraction: float) -> None:
        self.state = stage
        handle.publish_feedback(
            Diagnose.Feedback(stage=stage, fraction=min(max(fraction, 0.0), 1.0))
        )

    def _paths(self, goal: Diagnose.Goal, folder: Path) -> list[str]:
        """Return the recordings: the goal's, the replayed one, or what has been heard."""
        if goal.bags:
            return list(goal.bags)
        if self._comparing.settings.bag:
            return [self._comparing.settings.bag]
        messages = self._heard()
        if not messages:
            raise EscalatorError('bags: nothing is replayed and nothing has been heard')
        path = folder / 'heard'
        bagfile.write(path, messages)
        return [str(path)]

    def _target(self, goal: Diagnose.Goal) -> Path:
        """Return the extended machine's file: the goal's, or beside the JSON, or else here."""
        if goal.extended_machine:
            return Path(goal.extended_machine).absolute()
        if self._comparing.settings.json:
            stem = Path(self._comparing.settings.json).with_suffix('')
            return stem.with_name(f'{stem.name}_extended.yaml').absolute()
        return Path(f'{self._comparing.machine.name}_extended.yaml').absolute()


def _finished(handle: Handle, finish: Finish, result: Diagnose.Result) -> Diagnose.Result:
    finish(handle)
    return result


def _succeed(handle: Handle) -> None:
    handle.succeed()


def _abort(handle: Handle) -> None:
    handle.abort()


def _cancel(handle: Handle) -> None:
    if handle.is_cancel_requested:
        handle.canceled()
    else:
        handle.abort()
