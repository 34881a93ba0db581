"""The twin's topics: batches of samples turned into messages and sent."""

from collections.abc import Callable
import time

from rclpy.node import Node
from rclpy.publisher import Publisher
from rosgraph_msgs.msg import Clock
from visualization_msgs.msg import MarkerArray

from escalator_twin.machine import Machine
from escalator_twin.ros import qos
from escalator_twin.ros.markers import markers
from escalator_twin.ros.outputs import (
    Encoder,
    experiment_message,
    message_class,
    Output,
    outputs_of,
    POSITION,
    position_output,
    SensorEncoder,
    simulated_name,
)
from escalator_twin.ros.requests import time_message
from escalator_twin.ros.run import Batch, Run
from escalator_twin.ros.sender import Sender, Stream

MARKER_PERIOD_S = 0.05
MATCH_TIMEOUT_S = 10.0  # for a listener's subscriptions to be found
MATCH_LOOK_S = 0.02


class Publications:
    """All that a simulated run publishes.

    Parameters
    ----------
    node : Node
    machine : Machine
    frame : str
        Of the markers; empty: none are published.
    has_clock : bool
        Whether /clock is published.
    """

    def __init__(self, node: Node, machine: Machine, frame: str, has_clock: bool) -> None:
        self._node, self._machine, self._frame = node, machine, frame
        self.sender = Sender()
        self._topics = [
            (output, SensorEncoder(output).encode, self._publisher(output))
            for output in outputs_of(machine)
        ]
        place = position_output(machine)
        self._encode_place = Encoder(place.type, {}, (POSITION,)).encode
        self._place = self._publisher(place)
        self._experiment: Publisher | None = None
        topic = machine.instruments.experiment
        if topic is not None:
            name = simulated_name(machine, topic.topic)
            self._experiment = node.create_publisher(
                message_class(topic.type, name), name, qos.LATCHED
            )
        self._clock = node.create_publisher(Clock, '/clock', qos.CLOCK) if has_clock else None
        self._markers: Publisher | None = None
        if frame:
            name = simulated_name(machine, 'markers')
            self._markers = node.create_publisher(MarkerArray, name, qos.VIEWS)
        self._marked = 0.0

    def _publisher(self, output: Output) -> Publisher:
        kind = message_class(output.type, output.name)
        return self._node.create_publisher(kind, output.name, qos.SAMPLES)

    @property
    def fastest_hz(self) -> float:
        """Highest rate of an instrument."""
        return max(output.rate_hz for output, _, _ in self._topics)

    def begin(self, run: Run) -> None:
        """Tell a run's experiment; wait until whoever listens to it is connected."""
        if self._experiment is not None:
            order = run.order
            message = experiment_message(self._machine, order.experiment, order.epoch_ns)
            self.sender.publish(self._experiment.publish, message)
        if run.order.listener:
            self._wait_for_listener()

    def _wait_for_listener(self) -> None:
        """Wait until the topics that recordings have, too, reach all who subscribe to them."""
        needed = [p for output, _, p in self._topics if output.is_measured] + [self._place]
        limit = time.monotonic() + MATCH_TIMEOUT_S
        while time.monotonic() < limit and not all(map(self._is_matched, needed)):
            time.sleep(MATCH_LOOK_S)

    def _is_matched(self, publisher: Publisher) -> bool:
        known = self._node.count_subscribers(publisher.topic_name)
        return publisher.get_subscription_count() >= max(1, known)

    def emit(self, batch: Batch, run: Run) -> int:
        """Publish samples to those who are there; return how many messages."""
        streams = []
        for output, encode, publisher in self._topics:
            if not publisher.get_subscription_count():
                continue
            rate_hz = run.order.sample_rate_hz or output.rate_hz
            stride = max(1, round(batch.rate_hz / rate_hz))
            rows = slice(-batch.first % stride, None, stride)
            messages = encode(batch.stamp_ns[rows], batch.columns[rows])
            streams.append(Stream(publisher, messages, stride))
        if self._place.get_subscription_count():
            messages = self._encode_place(batch.stamp_ns, batch.place_m[:, None])
            streams.append(Stream(self._place, messages))
        n_sent = self.sender.send(streams, batch.first, len(batch.stamp_ns))
        stamp = time_message(int(batch.stamp_ns[-1]))
        if self._clock is not None:
            self._clock.publish(Clock(clock=stamp))
        self._emit_markers(run)
        if not run.order.listener:
            self.sender.wait_for_readers(streams, is_paced=run.is_paced)
        return n_sent

    def _emit_markers(self, run: Run) -> None:
        now = time.monotonic()
        if self._markers is not None and now - self._marked >= MARKER_PERIOD_S:
            self._marked = now
            self._markers.publish(markers(run.simulation, self._frame))

    def hold_back(self, n_sent: int, most_per_s: float, wait: Callable[[float], object]) -> None:
        """Keep the number of messages per second below a limit."""
        self.sender.hold_back(n_sent, most_per_s, wait)
