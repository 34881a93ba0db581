"""The comparator without a bag: hear the loggers, run the simulator beside them, compare.

What is heard is put into a bag and read like any other recording: what is compared live is what
the command line would read from a recording of the same messages.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import replace
import math
from pathlib import Path
import tempfile
import threading
import time

from rclpy.node import Node

from escalator_twin import bagfile
from escalator_twin.bagfile import Message
from escalator_twin.comparison.locate import LEAD_S, locate, Setting
from escalator_twin.errors import EscalatorError
from escalator_twin.machine import Machine
from escalator_twin.ros.comparing import Comparing
from escalator_twin.ros.inbox import Inbox, Source
from escalator_twin.ros.outputs import measured_name, measured_topics, message_class, NS
from escalator_twin.ros.requests import request_of
from escalator_twin.ros.windows import run_needed_s, span_of, window_s
from escalator_twin.signals import Recording
from escalator_twin.sync.timeline import time_all

TICK_S = 0.005
LIVE_NAME = 'measured topics'  # what a recording without a path is called
AHEAD_S = 0.5  # that the simulator runs ahead of what is heard
SLACK_S = 10.0  # heard after a window's end before it is compared, at most
RETRY_S = 5.0  # more of the stream before speed and place are looked for again


class Stream:
    """Measured messages as they come, the oldest dropped.

    Parameters
    ----------
    machine : Machine
    keep_s : float
    note : callable
        Gets each message.
    """

    def __init__(
        self, machine: Machine, keep_s: float, note: Callable[[list[Message]], None]
    ) -> None:
        self.machine, self._keep_ns, self._note = machine, round(keep_s * NS), note
        self._messages: deque[Message] = deque()
        self._once: dict[str, Message] = {}
        self._lock = threading.Lock()
        self.n_received = 0
        self.last_wall = 0.0
        instruments = machine.instruments
        self._types = {s.topic: s.type for s in instruments.sensors}
        if instruments.experiment is not None:
            self._types[instruments.experiment.topic] = instruments.experiment.type

    def sources(self) -> list[Source]:
        """Return the topics to listen to."""
        return [
            Source(
                measured_name(self.machine, topic),
                message_class(self._types[topic], topic),
                self._taker(topic),
            )
            for topic in measured_topics(self.machine)
        ]

    def _taker(self, topic: str) -> Callable[[bytes, int], None]:
        instruments = self.machine.instruments
        name, kind = instruments.measured_topic(topic), self._types[topic]
        is_once = instruments.experiment is not None and topic == instruments.experiment.topic

        def take(data: bytes, arrival_ns: int) -> None:
            message = Message(name, arrival_ns, data, kind)
            with self._lock:
                if is_once:
                    self._once[name] = message
                else:
                    self._messages.append(message)
                self.n_received += 1
                self.last_wall = time.monotonic()
                while (
                    arrival_ns - self._messages[0].bag_ns > self._keep_ns
                    if (self._messages)
                    else False
                ):
                    self._messages.popleft()

        return take

    def forget(self) -> None:
        """Drop everything: another stream begins."""
        with self._lock:
            self._messages.clear()

    def messages(self, last_s: float | None = None) -> list[Message]:
        """Return what is kept, or the last seconds of it; the experiment's message first."""
        with self._lock:
            kept, once = list(self._messages), list(self._once.values())
        if last_s is not None and kept:
            limit = kept[-1].bag_ns - round(last_s * NS)
            kept = [message for message in kept if message.bag_ns >= limit]
        first = kept[0].bag_ns if kept else 0
        return [message._replace(bag_ns=min(message.bag_ns, first)) for message in once] + kept

    @property
    def span_s(self) -> float:
        """Time between the first and the last message kept."""
        with self._lock:
            if not self._messages:
                return 0.0
            return (self._messages[-1].bag_ns - self._messages[0].bag_ns) / NS

    @property
    def silence_s(self) -> float:
        """Wall time since the last message."""
        return time.monotonic() - self.last_wall if self.last_wall else 0.0


class Listening:
    """Hears the measured topics.

    Parameters
    ----------
    node : Node
    comparing : Comparing
    """

    def __init__(self, node: Node, comparing: Comparing) -> None:
        self._comparing = comparing
        self._stream = Stream(
            comparing.machine, comparing.settings.keep_s, comparing.note_measured
        )
        is_simulated = node.get_parameter('use_sim_time').value
        clock = (lambda: node.get_clock().now().nanoseconds) if is_simulated else None
        self._inbox = Inbox(node, self._stream.sources(), clock)
        self._inbox.start()
        self._is_asked = threading.Event()
        self._noted_ns = -1

    def adapt(self) -> None:
        """Subscribe as the publishers offer."""
        self._inbox.adapt()

    def summarise(self) -> None:
        """Have everything kept compared now."""
        self._is_asked.set()

    def values(self) -> dict[str, object]:
        """Return figures for the diagnostics."""
        return {
            'measured messages': self._stream.n_received,
            'measured time kept (s)': self._stream.span_s,
        }

    def close(self) -> None:
        """Stop hearing."""
        self._inbox.close()

    def listen(self) -> None:
        """Compare one stream after the other, until the node ends."""
        comparing = self._comparing
        while True:
            self._is_asked.clear()
            comparing.say('listening')
            try:
                if self._hear_one():
                    self._summarise()
                    if comparing.settings.exit_at_end:
                        return
            except EscalatorError as error:
                comparing.say(f'not compared: {error}')
            self._stream.forget()
            self._stream.last_wall = 0.0

    def _is_over(self) -> bool:
        return self._is_asked.is_set() or (
            self._stream.silence_s > self._comparing.settings.timeout_s
        )

    def _hear_one(self) -> bool:
        """Hear a stream to its end, comparing its windows; False where there was none."""
        comparing, stream = self._comparing, self._stream
        experiment = comparing.settings.experiment(comparing.machine)
        length = window_s(comparing.settings.window_s, comparing.machine, experiment.set_speed_m_s)
        while stream.span_s < length:
            self._pause()
            if self._is_over():
                return stream.span_s > 0.0
        setting = self._placed(length)
        if setting is None:
            return True
        self._start(setting)
        length = comparing.window_s(setting)
        end = span_of(setting)[1]
        while not self._is_over():
            self._pause()
            # the simulator keeps step with what is heard
            comparing.link.hold(self._stream.span_s + LEAD_S)
            comparing.link.poll()
            travel = comparing.publish_ready()
            setting = replace(setting, travel=travel or setting.travel)
            if comparing.link.time_s >= run_needed_s(setting, end):
                recording = self._recording(length + SLACK_S)
                comparing.compare_later(
                    recording, self._again(setting, recording), end - length, end
                )
                comparing.link.run.forget(comparing.link.time_s - 2.0 * length)
                end += length
        return True

    def _placed(self, length: float) -> Setting | None:
        """Find speed and place as soon as the stream tells them; None where it ends before."""
        comparing = self._comparing
        heard = length
        while True:
            comparing.say('finding speed and place in the loop')
            try:
                setting = locate(self._recording(), comparing.machine)
            except EscalatorError as error:
                comparing.say(f'not yet placed: {error}')
            else:
                comparing.tell_quality(setting)
                return setting
            heard = max(heard, self._stream.span_s) + RETRY_S
            while self._stream.span_s < heard:
                self._pause()
                if self._is_over():
                    return None

    def _start(self, setting: Setting) -> None:
        """Start the simulator where the stream began, and have it catch up."""
        comparing = self._comparing
        comparing.say(f'{setting.experiment.set_speed_m_s:.5f} m/s: starting the simulator')
        link = comparing.link
        link.start(request_of(setting, 0.0, link.listener, AHEAD_S))
        comparing.say('comparing')

    def _summarise(self) -> None:
        """Run the simulator beside all that is kept, as `compare` would, and conclude."""
        comparing, link = self._comparing, self._comparing.link
        comparing.publish_ready(is_last=True)
        comparing.say('placing the whole stream')
        recording = self._recording()
        setting = locate(recording, comparing.machine)
        link.hold(math.inf)
        link.start(request_of(setting, 0.0, link.listener))
        while not link.is_complete:
            link.poll()
            comparing.pause(TICK_S)
        comparing.conclude(recording, setting)

    def _pause(self) -> None:
        """Wait a little; raise what made hearing fail."""
        if self._inbox.failure is not None:
            raise self._inbox.failure
        self._comparing.pause(TICK_S)

    def _recording(self, last_s: float | None = None) -> Recording:
        """Return what has been heard, read as from a bag."""
        machine, settings = self._comparing.machine, self._comparing.settings
        with tempfile.TemporaryDirectory(prefix='escalator-twin-') as folder:
            path = Path(folder) / 'stream'
            bagfile.write(path, self._stream.messages(last_s))
            recording = bagfile.read(path, machine)
        experiment = recording.experiment
        if experiment is None and settings.is_given():
            experiment = settings.experiment(machine)
        return replace(recording, path=LIVE_NAME, experiment=experiment)

    def _again(self, setting: Setting, recording: Recording) -> Setting:
        """Return a setting with other samples, its clocks, speed and place kept."""
        tracks = time_all(recording, self._comparing.machine, setting.clocks, setting.origin_ns)
        return replace(setting, tracks=tracks, findings=recording.findings)
