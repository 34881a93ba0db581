"""A recording played onto the measured topics, as it was recorded."""

from collections.abc import Iterator

from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher

from escalator_twin import bagfile
from escalator_twin.bagfile import Message
from escalator_twin.bagfile.reading import namespace_of, topic_name
from escalator_twin.errors import RecordingError
from escalator_twin.machine import Machine
from escalator_twin.ros import qos
from escalator_twin.ros.outputs import measured_name, measured_topics, message_class
from escalator_twin.ros.recorded_qos import recorded_qos
from escalator_twin.ros.sender import Sender


class Replay:
    """The publishers of a recording, and its messages in the order of bag time.

    Parameters
    ----------
    node : Node
    path : str
    machine : Machine
        Only its topics are played.

    Raises
    ------
    BagError, RecordingError, EscalatorError
        Where the bag cannot be read, has none of the topics, or holds a type that is not there.
    """

    def __init__(self, node: Node, path: str, machine: Machine) -> None:
        self._node, self._path = node, path
        self.sender = Sender()
        infos = [info for info in bagfile.topics(path) if info.n_messages]
        names = _names(machine, namespace_of(machine, infos))
        offered = recorded_qos(path)
        self._recorded_as = _recorded_as(machine, namespace_of(machine, infos))
        self.publishers: dict[str, Publisher] = {}
        for info in infos:
            if info.topic in names and info.topic not in self.publishers:
                self.publishers[info.topic] = node.create_publisher(
                    message_class(info.type, info.topic),
                    names[info.topic],
                    offered.get(info.topic, qos.SAMPLES),
                )
        if not self.publishers:
            wanted = ', '.join(sorted(names)[:4])
            raise RecordingError(f'{path}: none of the needed topics is there, such as {wanted}')
        played = [info for info in infos if info.topic in self.publishers]
        self.first_ns = min(info.first_ns for info in played)
        self.n_messages = sum(info.n_messages for info in played)
        self._messages: Iterator[Message] = iter(())
        self._next: Message | None = None
        self._from_ns = self.first_ns

    def matched(self) -> list[tuple[int, int]]:
        """Return how many subscribers are connected, and how many are known, per topic."""
        return [
            (
                publisher.get_subscription_count(),
                self._node.count_subscribers(publisher.topic_name),
            )
            for publisher in self.publishers.values()
        ]

    def begin(self, from_ns: int) -> list[Message]:
        """Go to a bag time; publish what came once, before it, such as the experiment."""
        self._messages = bagfile.messages(self._path, self.publishers)
        self._from_ns = from_ns
        counts: dict[str, int] = {}
        last: dict[str, Message] = {}
        for message in self._messages:
            if message.bag_ns >= from_ns:
                self._next = message
                break
            counts[message.topic] = counts.get(message.topic, 0) + 1
            last[message.topic] = message
        else:
            self._next = None
        once = [last[topic] for topic, n in counts.items() if n == 1]
        return [self._publish(message) for message in once]

    def play(self, until_s: float) -> list[Message]:
        """Publish up to a time since where it began; return what was published."""
        played = []
        limit = self._from_ns + round(until_s * 1e9)
        while self._next is not None and self._next.bag_ns <= limit:
            played.append(self._publish(self._next))
            self._next = next(self._messages, None)
        return played

    def finish(self) -> list[Message]:
        """Publish all that is left."""
        return self.play(1e9)

    def not_taken(self, timeout_s: float) -> list[str]:
        """Wait for every reliable subscriber; return the topics that one has not taken in full.

        A sample that the transport has dropped is sent again with the writer's next heartbeat,
        which comes seconds after the last sample: whoever leaves at once takes it along.
        """
        timeout = Duration(seconds=timeout_s)
        return [
            publisher.topic_name
            for publisher in self.publishers.values()
            if not publisher.wait_for_all_acked(timeout)
        ]

    @property
    def is_done(self) -> bool:
        """Tell whether all has been published."""
        return self._next is None

    def _publish(self, message: Message) -> Message:
        """Publish a message; return it as a measured one."""
        self.sender.publish(self.publishers[message.topic].publish, message.data)
        return message._replace(topic=self._recorded_as[message.topic])


def _names(machine: Machine, namespace: str) -> dict[str, str]:
    """Return the topics of a bag, and as what they are played."""
    return {
        topic_name(machine, namespace, topic): measured_name(machine, topic)
        for topic in measured_topics(machine)
    }


def _recorded_as(machine: Machine, namespace: str) -> dict[str, str]:
    """Return the topics of a bag, and how a recording calls them."""
    return {
        topic_name(machine, namespace, topic): machine.instruments.measured_topic(topic)
        for topic in measured_topics(machine)
    }
