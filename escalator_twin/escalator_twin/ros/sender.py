"""Publishing of samples: in the order of time, counted, no faster than can be taken."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
import time
from typing import Any

from rclpy.duration import Duration
from rclpy.publisher import Publisher

from escalator_twin.ros.qos import SAMPLE_DEPTH

BURST_S = 0.02  # of messages that may go at once
TAKEN_WITHIN_S = 2.0  # a subscriber that acknowledges later has lost samples


@dataclass
class Stream:
    """One topic and the messages that are to go out on it.

    Attributes
    ----------
    publisher : Publisher
    messages : list of bytes
        Serialised, one each ``stride`` rows.
    stride : int
    """

    publisher: Publisher
    messages: Sequence[bytes] = ()
    stride: int = 1


class Sender:
    """Counts what is sent and what DDS could not take."""

    def __init__(self) -> None:
        self.sent = 0
        self.failed = 0
        self.unacknowledged = 0
        self._since_check = 0
        self._free_at = time.monotonic()

    def send(self, streams: Sequence[Stream], first: int, n_rows: int) -> int:
        """Publish rows in the order of time; a stream's stride counts from row 0.

        Returns
        -------
        n : int
            How many messages were sent.
        """
        before = self.sent
        for row in range(first, first + n_rows):
            for stream in streams:
                if row % stream.stride == 0:
                    place = row // stream.stride - -(-first // stream.stride)
                    self.publish(stream.publisher.publish, stream.messages[place])
        self._since_check += n_rows
        return self.sent - before

    def publish(self, publish: Callable[[Any], None], message: Any) -> None:
        """Publish one message and count it."""
        try:
            publish(message)
            self.sent += 1
        except RuntimeError:  # what rclpy makes of an rcl error
            self.failed += 1

    def hold_back(self, n_sent: int, most_per_s: float, wait: Callable[[float], object]) -> None:
        """Wait until as many messages as were sent may be sent again."""
        if most_per_s <= 0.0:
            return
        now = time.monotonic()
        self._free_at = max(self._free_at, now - BURST_S) + n_sent / most_per_s
        if self._free_at > now:
            wait(self._free_at - now)

    def wait_for_readers(self, streams: Sequence[Stream], is_paced: bool) -> None:
        """Wait, unless a pace is kept, for acknowledgement before a history is full.

        What a reader does not acknowledge in time is counted.
        """
        if is_paced or self._since_check < SAMPLE_DEPTH // 2:
            return
        timeout = Duration(seconds=TAKEN_WITHIN_S)
        late = [not stream.publisher.wait_for_all_acked(timeout) for stream in streams]
        self.unacknowledged += self._since_check * sum(late)
        self._since_check = 0
