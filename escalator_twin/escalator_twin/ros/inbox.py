"""Samples from DDS: drained by a thread, not waited for.

An executor's wait set costs some fifty microseconds a message, draining a subscription three to
five: at ten thousand messages a second this decides whether they are lost.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
import threading
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription

from escalator_twin.ros import qos

PERIOD_S = 0.005  # between two rounds: a twentieth of what the histories hold at 10 kHz a topic


class _Drained(CallbackGroup):
    """Keeps its subscriptions out of the executor's wait set."""

    def can_execute(self, _: Any) -> bool:
        return False

    def beginning_execution(self, _: Any) -> bool:
        return False

    def ending_execution(self, _: Any) -> None:
        pass


@dataclass
class Source:
    """One topic that is listened to.

    Attributes
    ----------
    name : str
        As the node calls it, before remapping.
    kind : type
        Message class.
    take : callable
        Gets (serialised message, time of arrival in ns), in the draining thread.
    """

    name: str
    kind: Any
    take: Callable[[bytes, int], None]
    profile: QoSProfile = field(default_factory=lambda: qos.SAMPLES)
    subscription: Subscription | None = None


class Inbox(threading.Thread):
    """Drains subscriptions.

    Parameters
    ----------
    node : Node
    sources : sequence of Source
    now_ns : callable, optional
        The clock of arrivals; by default the one of the middleware.
    """

    def __init__(
        self, node: Node, sources: Sequence[Source], now_ns: Callable[[], int] | None = None
    ) -> None:
        super().__init__(name='inbox', daemon=True)
        self._node, self._sources, self._now_ns = node, list(sources), now_ns
        self._group = _Drained()
        self._closing = threading.Event()
        self.failure: BaseException | None = None
        for source in self._sources:
            self._subscribe(source)

    def _subscribe(self, source: Source) -> None:
        old = source.subscription
        source.subscription = self._node.create_subscription(
            source.kind,
            source.name,
            lambda _: None,
            source.profile,
            callback_group=self._group,
            raw=True,
        )
        if old is not None:
            self._node.destroy_subscription(old)

    def adapt(self) -> None:
        """Subscribe as the publishers that are there offer, where they offer less."""
        for source in self._sources:
            assert source.subscription is not None
            infos = self._node.get_publishers_info_by_topic(source.subscription.topic_name)
            profiles = [info.qos_profile for info in infos]
            if not profiles:
                continue
            is_weak = any(p.reliability == ReliabilityPolicy.BEST_EFFORT for p in profiles)
            is_kept = all(p.durability == DurabilityPolicy.TRANSIENT_LOCAL for p in profiles)
            wanted = qos.samples_like(
                'best_effort' if is_weak else 'reliable',
                'transient_local' if is_kept else 'volatile',
            )
            if (wanted.reliability, wanted.durability) != (
                source.profile.reliability,
                source.profile.durability,
            ):
                source.profile = wanted
                self._subscribe(source)

    def is_connected(self) -> bool:
        """Tell whether every topic has a publisher."""
        return all(s.subscription.get_publisher_count() for s in self._sources if s.subscription)

    def run(self) -> None:
        """Drain until closed."""
        try:
            while not self._closing.wait(PERIOD_S):
                for source in self._sources:
                    self._drain(source)
        except BaseException as failure:
            self.failure = failure

    def _drain(self, source: Source) -> None:
        subscription = source.subscription
        assert subscription is not None
        handle = subscription.handle
        try:
            with handle:
                while (taken := handle.take_message(source.kind, True)) is not None:
                    message, info = taken
                    arrival = self._now_ns() if self._now_ns else info['received_timestamp']
                    source.take(message, arrival)
        except rclpy_implementation.InvalidHandle:
            return  # replaced in the meantime

    def close(self) -> None:
        """End the thread."""
        self._closing.set()
        if self.is_alive():
            self.join()
