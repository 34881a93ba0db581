"""The comparator without a bag: hear the loggers, run the simulator beside them, compare.

What is heard is put into a bag and read like any other recording: what is compared live is what
the command line would read from a recording of the same messages.
"""

from dataclasses import replace
import math
from pathlib import Path
import tempfile
import threading

from rclpy.node import Node

from escalator_twin import bagfile
from escalator_twin.bagfile import Message
from escalator_twin.comparison.locate import LEAD_S, locate, Setting
from escalator_twin.errors import EscalatorError
from escalator_twin.ros.comparing import Comparing
from escalator_twin.ros.inbox import Inbox
from escalator_twin.ros.requests import request_of
from escalator_twin.ros.stream import Stream
from escalator_twin.ros.windows import recorder_shift_ns, run_needed_s, span_of, window_s
from escalator_twin.signals import Recording
from escalator_twin.sync.timeline import time_all

TICK_S = 0.005
LIVE_NAME = 'measured topics'  # what a recording without a path is called
AHEAD_S = 0.5  # that the simulator runs ahead of what is heard
SLACK_S = 10.0  # heard after a window's end before it is compared, at most
RETRY_S = 5.0  # more of the stream before speed and place are looked for again


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
        self._has_run = False

    def adapt(self) -> None:
        """Subscribe as the publishers offer."""
        self._inbox.adapt()

    def summarise(self) -> None:
        """Have everything kept compared now."""
        self._is_asked.set()

    def messages(self) -> list[Message]:
        """Return what is kept of what has been heard."""
        return self._stream.messages() if self._stream.span_s else []

    def values(self) -> dict[str, object]:
        """Return figures for the diagnostics."""
        return {
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
            self._has_run = False
            comparing.take_machine()
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
            if comparing.take_machine():
                self._start(setting)
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
                recording = self._recording()
                setting = locate(recording, comparing.machine)
            except EscalatorError as error:
                comparing.say(f'not yet placed: {error}')
            else:
                comparing.tell_quality(setting)
                comparing.note_simulated(recorder_shift_ns(recording, setting.origin_ns))
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
        self._has_run = True
        link = comparing.link
        link.start(request_of(setting, 0.0, link.listener, AHEAD_S))
        comparing.say('comparing')

    def _summarise(self) -> None:
        """Run the simulator beside all that is kept, as `compare` would, and conclude."""
        comparing, link = self._comparing, self._comparing.link
        comparing.publish_ready(is_last=True)
        comparing.take_machine()
        comparing.say('placing the whole stream')
        recording = self._recording()
        setting = locate(recording, comparing.machine)
        link.hold(math.inf)
        if self._has_run:
            comparing.note_simulated(None)  # the session has what was heard beside the stream
        else:
            comparing.note_simulated(recorder_shift_ns(recording, setting.origin_ns))
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
