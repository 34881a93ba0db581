"""What replaying and listening have in common: the simulated run, judging, results."""

from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
import queue
import threading
from typing import Any

from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.serialization import serialize_message

from escalator_twin.bagfile import Message
from escalator_twin.comparison.document import recording_document, SCHEMA
from escalator_twin.comparison.judge import judge, Judgement
from escalator_twin.comparison.locate import Setting
from escalator_twin.errors import EscalatorError
from escalator_twin.machine import Machine
from escalator_twin.physics.course import course_of
from escalator_twin.physics.rollout import Trace
from escalator_twin.ros.files import find_machine, write_json
from escalator_twin.ros.link import SimulatorLink
from escalator_twin.ros.outputs import NS, Output
from escalator_twin.ros.results import comparison_message, quality_message
from escalator_twin.ros.session import note_aligned, Session
from escalator_twin.ros.settings import ComparatorSettings
from escalator_twin.ros.windows import cut_setting, span_of, window_s
from escalator_twin.ros.worker import Stopped
from escalator_twin.signals import Nanoseconds, Recording
from escalator_twin.sync.travel import Travel

WAIT_S = 0.1  # between two looks at whether there is another machine
COMPARISON_TYPE = 'escalator_msgs/msg/Comparison'


@dataclass(frozen=True)
class Topics:
    """Where results go."""

    comparison: Publisher
    summary: Publisher
    quality: Publisher


class Comparing:
    """The means of a comparison.

    Parameters
    ----------
    node : Node
    settings : ComparatorSettings
    machine : Machine
    topics : Topics
    """

    def __init__(
        self, node: Node, settings: ComparatorSettings, machine: Machine, topics: Topics
    ) -> None:
        self.node, self.settings, self.machine = node, settings, machine
        self.machine_path = settings.machine
        self.state = 'starting'
        self.n_compared = self.n_measured = 0
        self._shift_ns = 0
        self.closing = threading.Event()
        self._handed_over: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._last_bag_ns = 0
        self.link = SimulatorLink(node, machine, self.pause)
        self.session = Session(settings.session, machine) if settings.session else None
        self._topics = topics
        self._judge = ThreadPoolExecutor(1, thread_name_prefix='judge')
        self._pending: list[tuple[Future[Any], Setting]] = []
        self._length_m = course_of(machine).length_m

    def pause(self, seconds: float) -> None:
        """Wait; raise `Stopped` where the node is to end."""
        if self.closing.wait(seconds):
            raise Stopped

    def say(self, text: str) -> None:
        """Log what happens now; the diagnostics repeat it."""
        self.state = text
        self.node.get_logger().info(text)

    # another machine

    def hand_over(self, path: str) -> None:
        """Have the simulator take another description over; compare with that from its next start.

        Raises
        ------
        EscalatorError
            Where it does not.
        """
        self.link.set_machine(path)
        self._handed_over.put(path)

    def wait_for_machine(self) -> None:
        """Wait until the simulator has another machine."""
        while self._handed_over.empty():
            self.pause(WAIT_S)

    def take_machine(self) -> bool:
        """Compare with the machine that the simulator took over; tell whether there is one.

        The session ends: in another one, what is simulated would stand beside it once more.
        """
        if self._handed_over.empty():
            return False
        while not self._handed_over.empty():
            self.machine_path = self._handed_over.get()
        self.machine = find_machine(self.machine_path)
        self.note_simulated(None)
        session, self.session = self.session, None
        if session is not None:
            session.close()
        self.say(f'comparing with {self.machine_path}')
        return True

    @property
    def json(self) -> str:
        """File for the result: one of its own where the machine is another one; '' for none."""
        path = self.settings.json
        if not path or self.machine_path == self.settings.machine:
            return path
        return str(Path(path).with_suffix('')) + '_extended.json'

    # samples

    def note_measured(self, messages: list[Message]) -> None:
        """Count measured messages and put them into the session."""
        self.n_measured += len(messages)
        if self.session is not None:
            for message in messages:
                self.session.add(message)

    def note_simulated(self, shift_ns: int | None) -> None:
        """Have what is heard of the simulator put into the session, or no more of it.

        Parameters
        ----------
        shift_ns : int or None
            The recorder's clock less that of the stamps; ``None``: no more.
        """
        session = self.session
        if session is None or shift_ns is None:
            self.link.hand_on = None
            return
        self._shift_ns = shift_ns

        def note(output: Output, stamps: Nanoseconds, messages: list[bytes]) -> None:
            for stamp, data in zip(stamps.tolist(), messages, strict=True):
                session.add(Message(f'/{output.name}', stamp + shift_ns, data, output.type))

        self.link.hand_on = note

    def trace(self) -> Trace:
        """Return the simulated run as far as it has come."""
        return self.link.run.trace(self._length_m)

    # results

    def tell_quality(self, setting: Setting) -> None:
        """Publish what is wrong with a recording."""
        for finding in setting.findings:
            self._topics.quality.publish(quality_message({
                'kind': finding.kind, 'channel': finding.channel, 'from_s': finding.from_s,
                'to_s': finding.to_s, 'detail': finding.detail, 'repaired': finding.repaired,
            }))  # fmt: skip

    def window_s(self, setting: Setting) -> float:
        """Return the length of a window."""
        return window_s(self.settings.window_s, self.machine, setting.experiment.set_speed_m_s)

    def compare_later(
        self, recording: Recording, setting: Setting, from_s: float, to_s: float
    ) -> None:
        """Have a window judged beside everything else."""
        part = cut_setting(setting, from_s, to_s)
        future = self._judge.submit(self._compare, recording, part, self.trace())
        self._pending.append((future, part))

    def publish_ready(self, is_last: bool = False) -> Travel | None:
        """Publish the windows that have been judged; wait for all of them at last.

        Returns
        -------
        travel : Travel or None
            Of the last one among them.
        """
        travel = None
        while self._pending and (is_last or self._pending[0][0].done()):
            future, part = self._pending.pop(0)
            try:
                document, judgement = future.result()
            except EscalatorError as error:
                self.node.get_logger().warning(f'a window could not be compared: {error}')
                continue
            travel = judgement.travel
            self._publish(document, part, is_final=False)
        return travel

    def conclude(self, recording: Recording, setting: Setting) -> None:
        """Judge the whole recording; publish and write the result."""
        self.publish_ready(is_last=True)
        self.say('comparing the whole recording')
        document, judgement = self._compare(recording, setting, self.trace())
        if self.session is not None:
            note_aligned(self.session, judgement, setting.origin_ns, self._shift_ns)
        if self.json:
            whole = {'schema': SCHEMA, 'machine': self.machine_path, 'recordings': [document]}
            write_json(self.json, whole)
        self._publish(document, setting, is_final=True)
        run = self.link.run
        self.say(
            f'compared {document["path"]}: {self.n_measured} measured and {run.n_received} '
            f'simulated messages, {run.n_lost} lost, {run.n_disordered} out of order'
        )

    def _compare(
        self, recording: Recording, setting: Setting, trace: Trace
    ) -> tuple[dict[str, Any], Judgement]:
        judgement = judge(setting, trace, self.machine)
        return recording_document(recording, setting, judgement, self.machine), judgement

    def _publish(self, document: dict[str, Any], setting: Setting, is_final: bool) -> None:
        span = span_of(setting)
        end_ns = setting.origin_ns + round(span[1] * NS)
        message = comparison_message(document, span, end_ns, is_final)
        self._topics.comparison.publish(message)
        if is_final:
            self._topics.summary.publish(message)
        self._last_bag_ns = end_ns + self._shift_ns
        name = self._topics.comparison.topic_name
        self.note_result(name, serialize_message(message), COMPARISON_TYPE)
        self.n_compared += 1

    def note_result(self, topic: str, data: bytes, kind: str) -> None:
        """Put a result into the session, at the time of the last comparison."""
        session = self.session
        if session is not None and self._last_bag_ns:
            session.add(Message(f'/{topic.lstrip("/")}', self._last_bag_ns, data, kind))

    def close(self) -> None:
        """End the judging, finish the session."""
        self._judge.shutdown(wait=True, cancel_futures=True)
        if self.session is not None:
            self.session.close()
