"""The comparator's side of the simulator: start it, hear it, tell it how far one has heard."""

from collections.abc import Callable
import math
import time

from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.node import Node
from std_msgs.msg import Header

from escalator_msgs.srv import StartExperiment
from escalator_twin.errors import EscalatorError
from escalator_twin.machine import Machine
from escalator_twin.ros import qos
from escalator_twin.ros.heard import HeardRun
from escalator_twin.ros.inbox import Source
from escalator_twin.ros.outputs import message_class, NS, Output, simulated_name
from escalator_twin.ros.requests import time_message, time_ns
from escalator_twin.signals import Nanoseconds

SERVICE = 'simulator/start_experiment'
SETTING = 'simulator/set_parameters'
SETTING_S = 10.0  # for an answer, which a description read and checked takes a part of a second
TRIES = 3  # of a start whose first samples did not come
FIRST_SAMPLES_S = 5.0  # in which they must
ANSWER_S = 150.0  # for a start: an equilibrium takes a second or two on an idle machine
LOST_S = 40.0  # after which a request counts as lost
STARTS_S = 2.0  # within which a simulator stops what it does when it is to start anew
FLOWS_S = 0.5  # since the last sample: what comes is of a run in progress
PATIENCE_S = 10.0  # of silence before a word is said about it
TELL_S = 0.1  # of simulated time between two words on how far has been heard


class SimulatorLink:
    """A simulator that runs elsewhere.

    Parameters
    ----------
    node : Node
    machine : Machine
    pause : callable
        Waits that many seconds; raises `Stopped` where the node is to end.
    """

    def __init__(self, node: Node, machine: Machine, pause: Callable[[float], None]) -> None:
        self._node, self._pause = node, pause
        self.run = HeardRun(machine)
        self.listener = node.get_fully_qualified_name()
        self._client = node.create_client(StartExperiment, SERVICE)
        self._setting = node.create_client(SetParameters, SETTING)
        self._heard = node.create_publisher(Header, simulated_name(machine, 'heard'), qos.EVENTS)
        self._told_rows = 0.0
        self.n_samples = 0
        self.limit_s = math.inf
        self._came = 0.0
        self.hand_on: Callable[[Output, Nanoseconds, list[bytes]], None] | None = None

    def sources(self) -> list[Source]:
        """Return the topics to listen to."""
        return [
            Source(
                part.output.name,
                message_class(part.output.type, part.output.name),
                self._taker(number),
            )
            for number, part in enumerate(self.run.parts)
        ]

    def _taker(self, number: int) -> Callable[[bytes, int], None]:
        def take(message: bytes, _: int) -> None:
            self._came = time.monotonic()
            self.run.take(number, message)

        return take

    def start(self, request: StartExperiment.Request) -> None:
        """Start a run and wait until its first samples have come.

        Raises
        ------
        EscalatorError
            Where the simulator does not accept, or its samples do not come.
        """
        for _ in range(TRIES):
            self.run.begin()
            self._told_rows = 0.0
            answer = self._call(request)
            if not answer.accepted:
                raise EscalatorError(f'{SERVICE}: {answer.message}')
            self.run.set_time(time_ns(answer.stamp), answer.sample_rate)
            self.n_samples = int(answer.samples)
            if self._has_begun():
                return
            self._node.get_logger().warning('the first simulated samples did not come: again')
        missing = [p.output.name for p in self.run.parts if not p.is_begun]
        raise EscalatorError(f'no simulated samples on {", ".join(missing)}')

    def _call(self, request: StartExperiment.Request) -> StartExperiment.Response:
        since = time.monotonic()
        while not self._client.service_is_ready():
            self._pause(0.05)
            if time.monotonic() - since > PATIENCE_S:
                since = time.monotonic()
                self._node.get_logger().warning(f'waiting for the service {SERVICE}')
        limit = time.monotonic() + ANSWER_S
        while time.monotonic() < limit:
            answer = self._client.call_async(request)
            called = time.monotonic()
            while not answer.done() and not self._is_lost(called):
                self._pause(0.01)
            if answer.done():
                return answer.result()
            self._client.remove_pending_request(answer)
        raise EscalatorError(f'{SERVICE}: no answer within {ANSWER_S:.0f} s')

    def set_machine(self, path: str) -> None:
        """Have the simulator take a machine's description over, from its next start.

        Raises
        ------
        EscalatorError
            Where it refuses, or does not answer.
        """
        value = ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=path)
        request = SetParameters.Request(parameters=[Parameter(name='machine', value=value)])
        for _ in range(TRIES):
            answer = self._setting.call_async(request)
            limit = time.monotonic() + SETTING_S
            while not answer.done() and time.monotonic() < limit:
                self._pause(0.01)
            if answer.done():
                (result,) = answer.result().results
                if not result.successful:
                    raise EscalatorError(f'simulator: {result.reason}')
                return
            self._setting.remove_pending_request(answer)
        raise EscalatorError(f'{SETTING}: no answer within {TRIES * SETTING_S:.0f} s')

    def _is_lost(self, called: float) -> bool:
        """Tell whether an answer will not come: nothing has, or samples flow without it.

        DDS drops an answer where the client has not been discovered yet.
        """
        now = time.monotonic()
        flows = now - self._came < FLOWS_S and now - called > FLOWS_S + STARTS_S
        return flows or now - called > LOST_S

    def _has_begun(self) -> bool:
        limit = time.monotonic() + FIRST_SAMPLES_S
        while time.monotonic() < limit and not self.run.is_cut:
            self.poll()
            if self.run.is_begun:
                return True
            self._pause(0.01)
        return False

    def poll(self) -> None:
        """Decode what has come, hand it on, and tell the simulator how far that is."""
        for output, stamps, messages in self.run.decode():
            if self.hand_on is not None:
                self.hand_on(output, stamps, messages)
        self._tell()

    def hold(self, limit_s: float) -> None:
        """Let the simulator not run on beyond a time since the start."""
        self.limit_s = limit_s

    @property
    def time_s(self) -> float:
        """Simulated time since the start up to which everything has come."""
        return self.run.n_rows / self.run.rate_hz

    @property
    def is_complete(self) -> bool:
        """Tell whether the run has come to its end."""
        return 0 < self.n_samples <= self.run.n_rows

    def _tell(self) -> None:
        rows = min(self.run.n_rows, self.limit_s * self.run.rate_hz)
        if rows != self._told_rows and (
            rows - self._told_rows >= TELL_S * self.run.rate_hz or rows == self.n_samples
        ):
            self._told_rows = rows
            stamp = self.run.epoch_ns + round(rows * NS / self.run.rate_hz)
            self._heard.publish(Header(stamp=time_message(stamp), frame_id=self.listener))

    def complain(self) -> None:
        """Say that nothing comes; raise an EscalatorError where the simulator is gone."""
        if not self._client.service_is_ready():
            raise EscalatorError('the simulator has gone')
        self._node.get_logger().warning(
            f'no simulated samples for {PATIENCE_S:.0f} s: is the simulator paused?'
        )
