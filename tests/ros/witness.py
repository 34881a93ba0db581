"""An independent listener: every message of some topics, in the order of arrival."""

from importlib import import_module
import struct
import threading
import time
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.qos import QoSProfile


class Aside(CallbackGroup):
    """Callbacks of nobody: an executor would not keep up with ten thousand messages a second."""

    def can_execute(self, _: Any) -> bool:
        return False

    def beginning_execution(self, _: Any) -> bool:
        return False

    def ending_execution(self, _: Any) -> None:
        pass


def message_class(kind: str) -> Any:
    package, _, name = kind.split('/')
    return getattr(import_module(f'{package}.msg'), name)


class Witness:
    """Listens from its making until `close`."""

    def __init__(self, node: Any, topics: dict[str, str], depth: int = 5000) -> None:
        self.heard: dict[str, list[bytes]] = {topic: [] for topic in topics}
        self._node = node
        self._subscriptions = [
            node.create_subscription(
                message_class(kind),
                topic,
                lambda _: None,
                QoSProfile(depth=depth),
                raw=True,
                callback_group=Aside(),
            )
            for topic, kind in topics.items()
        ]
        self._kinds = [message_class(kind) for kind in topics.values()]
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def _listen(self) -> None:
        while not self._closing.wait(0.004):
            self._drain()
        self._drain()

    def _drain(self) -> None:
        for subscription, kind, heard in zip(
            self._subscriptions, self._kinds, self.heard.values(), strict=True
        ):
            handle = subscription.handle
            with handle:
                while (taken := handle.take_message(kind, True)) is not None:
                    heard.append(taken[0])

    def wait_for(self, counts: dict[str, int], timeout: float = 30.0) -> None:
        """Wait until as many messages have come on each topic; return in any case in the end."""
        limit = time.monotonic() + timeout
        while time.monotonic() < limit:
            if all(len(self.heard[topic]) >= n for topic, n in counts.items()):
                return
            time.sleep(0.02)

    def wait_until_silent(self, quiet_s: float = 1.0, timeout: float = 60.0) -> None:
        limit, last, since = time.monotonic() + timeout, -1, time.monotonic()
        while time.monotonic() < limit:
            n = sum(map(len, self.heard.values()))
            if n != last:
                last, since = n, time.monotonic()
            elif time.monotonic() - since > quiet_s:
                return
            time.sleep(0.02)

    def close(self) -> None:
        self._closing.set()
        self._thread.join()
        for subscription in self._subscriptions:
            self._node.destroy_subscription(subscription)


def stamp_ns(message: bytes) -> int:
    """Return the stamp of a little-endian message that begins with a header."""
    seconds, nanoseconds = struct.unpack_from('<iI', message, 4)
    return seconds * 1_000_000_000 + nanoseconds
