"""The simulator as a node: what the twin's instruments read, at a pace, on request."""

from collections.abc import Callable
import sys
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import Header
from std_srvs.srv import SetBool, Trigger

from escalator_msgs.srv import StartExperiment, Step
from escalator_twin.errors import EscalatorError
from escalator_twin.ros import diagnostics, qos, simulator_status
from escalator_twin.ros.engine import Engine
from escalator_twin.ros.files import find_machine
from escalator_twin.ros.outputs import check_same_topics, NS, simulated_name
from escalator_twin.ros.parameters import declare, follow
from escalator_twin.ros.publications import Publications
from escalator_twin.ros.requests import order_of, time_message, time_ns
from escalator_twin.ros.run import Batch, Order, Run
from escalator_twin.ros.settings import SimulatorSettings
from escalator_twin.ros.spin import Program, run

NAME = 'simulator'
DIAGNOSTICS_PERIOD_S = 1.0
COMMAND_TIMEOUT_S = 120.0  # an equilibrium takes a second or two on an idle machine
AHEAD = 0.25  # of the samples that a history holds: how far a listener may be behind


class SimulatorNode(Program):
    """Publishes what the twin's instruments read."""

    def __init__(self) -> None:
        super().__init__(NAME)
        self.settings = declare(self, SimulatorSettings)
        self._live = {'message_rate': self.settings.message_rate}
        self._source = self.settings.machine
        self.machine = find_machine(self._source)
        frame = self.settings.frame_id if self.settings.markers else ''
        self.publications = Publications(self, self.machine, frame, self.settings.publish_clock)
        ahead_s = AHEAD * qos.SAMPLE_DEPTH / self.publications.fastest_hz
        self.engine = Engine(self.machine, self._emit, ahead_s, self.settings.real_time_factor)
        self._status = self.create_publisher(DiagnosticArray, '/diagnostics', qos.EVENTS)
        self.create_subscription(
            Header, simulated_name(self.machine, 'heard'), self._on_heard, qos.EVENTS
        )
        self.create_service(StartExperiment, f'{NAME}/start_experiment', self._on_start)
        self.create_service(SetBool, f'{NAME}/pause', self._on_pause)
        self.create_service(Step, f'{NAME}/step', self._on_step)
        self.create_service(Trigger, f'{NAME}/reset', self._on_reset)
        self.create_timer(DIAGNOSTICS_PERIOD_S, self._report)
        follow(self, SimulatorSettings, self._on_setting)
        self.engine.start()
        if self.settings.autostart:
            experiment = self.settings.experiment(self.machine)
            first = Order(experiment, self.settings.start_s, epoch_ns=self.epoch_ns)
            self._command(lambda: self._begin(first))

    @property
    def epoch_ns(self) -> int:
        """Time in the stamps where a run begins that asks for no other."""
        return round(self.settings.epoch * NS)

    def is_over(self) -> bool:
        """Tell whether the process may end: never by itself."""
        if self.engine.failure is not None:
            raise self.engine.failure
        return False

    def close(self) -> None:
        """Stop the simulation."""
        self.engine.close()

    # in the simulation's thread

    def _begin(self, order: Order) -> Run:
        started = self.engine.start_run(order)
        self.publications.begin(started)
        return started

    def _emit(self, batch: Batch, current: Run) -> None:
        n_sent = self.publications.emit(batch, current)
        if not current.order.listener:
            self.publications.hold_back(n_sent, self._live['message_rate'], time.sleep)

    # in the executor's thread

    def _command(self, command: Callable[[], Any]) -> Any:
        return self.engine.submit(command).result(timeout=COMMAND_TIMEOUT_S)

    def _on_heard(self, message: Header) -> None:
        self.engine.heard(message.frame_id, time_ns(message.stamp))

    def _on_start(
        self, request: StartExperiment.Request, response: StartExperiment.Response
    ) -> StartExperiment.Response:
        try:
            order = order_of(request, self.machine, self.epoch_ns)
            started = self._command(lambda: self._begin(order))
        except EscalatorError as error:
            response.accepted, response.message = False, str(error)
            return response
        response.accepted = True
        response.stamp = time_message(order.epoch_ns)
        response.sample_rate = started.rate_hz
        response.samples = started.n_samples
        return response

    def _on_pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        response.success, response.message = self._try(lambda: self.engine.pause(request.data))
        return response

    def _on_reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        response.success, response.message = self._try(
            lambda: self._begin(self.engine.present().order)
        )
        return response

    def _on_step(self, request: Step.Request, response: Step.Response) -> Step.Response:
        response.accepted, response.message = self._try(
            lambda: self.engine.step(request.duration, request.steps)
        )
        if self.engine.run_now is not None:
            response.stamp = time_message(self.engine.run_now.time_ns)
        return response

    def _try(self, command: Callable[[], Any]) -> tuple[bool, str]:
        """Carry out a command; tell whether it could be, and why not."""
        try:
            self._command(command)
        except EscalatorError as error:
            return False, str(error)
        return True, ''

    def _on_setting(self, name: str, value: Any) -> None:
        if name == 'machine':
            self._take_over(value)
        elif name in self._live:
            self._live[name] = value
        else:
            self.engine.submit(lambda: self.engine.set_pace(value))

    def _take_over(self, path: str) -> None:
        """Have another description of the same instruments from the next start."""
        machine = find_machine(path)
        check_same_topics(machine, self.machine, path)
        self._command(lambda: self.engine.take_over(machine))
        self.machine, self._source = machine, path
        self.get_logger().info(f'{path}: taken over, from the next start')

    def _report(self) -> None:
        level, message = simulator_status.level_of(self.engine, self.publications.sender)
        values = simulator_status.values_of(self.engine, self.publications.sender)
        values['machine'] = self._source
        stamp = self.get_clock().now().to_msg()
        name = f'{self.get_name()}: twin of {self.machine.name}'
        self._status.publish(diagnostics.array(stamp, name, level, message, values))


def main() -> int:
    """Run the node; the program ``simulator``."""
    return run(SimulatorNode, NAME)


if __name__ == '__main__':
    sys.exit(main())
