"""The comparator with a bag: replay it in step with the simulator and compare."""

from dataclasses import replace
import time

from escalator_twin import bagfile
from escalator_twin.comparison.locate import LEAD_S, locate, Setting
from escalator_twin.ros.comparing import Comparing
from escalator_twin.ros.link import PATIENCE_S
from escalator_twin.ros.outputs import NS
from escalator_twin.ros.replay import Replay
from escalator_twin.ros.requests import request_of
from escalator_twin.ros.windows import ends, recorder_shift_ns, span_of, without_start
from escalator_twin.signals import Recording

TICK_S = 0.005
DISCOVERY_S = 3.0  # before that nobody need have been discovered: two seconds have been seen
STEADY_S = 1.0  # without a newly found subscriber: a node's are found one after the other
MATCH_TIMEOUT_S = 10.0  # for subscribers of the measured topics to be found
TAKEN_WITHIN_S = 5.0  # the last samples, by each topic's subscribers; a heartbeat comes within 3 s


def replay(comparing: Comparing, player: Replay) -> None:
    """Place the recording that the settings name in the loop; play it as often as asked for.

    Once more where the simulator has taken another machine over.
    """
    settings, since = comparing.settings, time.monotonic()
    comparing.say(f'reading {settings.bag}')
    recording = bagfile.read(settings.bag, comparing.machine)
    if recording.experiment is None and settings.is_given():
        given = settings.experiment(comparing.machine)
        recording = replace(recording, experiment=given)
    from_ns = player.first_ns + round(settings.start_offset_s * NS)
    if settings.start_offset_s:
        recording = without_start(recording, from_ns)
    setting = _placed(comparing, recording)
    _await_listeners(comparing, player, since + DISCOVERY_S)
    play_once(comparing, player, recording, setting, from_ns)
    while settings.loop or not settings.exit_at_end:
        if not settings.loop:
            comparing.wait_for_machine()
        if comparing.take_machine():
            setting = _placed(comparing, recording)
        play_once(comparing, player, recording, setting, from_ns)


def _placed(comparing: Comparing, recording: Recording) -> Setting:
    """Find where in the loop a recording begins, and how fast it is; tell its quality."""
    comparing.say('finding speed and place in the loop')
    setting = locate(recording, comparing.machine)
    comparing.say(
        f'{setting.experiment.set_speed_m_s:.5f} m/s, axle 0 at {setting.start_s_m:.3f} m: '
        f'waiting for the simulator'
    )
    comparing.tell_quality(setting)
    comparing.note_simulated(recorder_shift_ns(recording, setting.origin_ns))
    return setting


def _await_listeners(comparing: Comparing, player: Replay, earliest: float) -> None:
    """Wait until who listens is connected: what is played before that is lost on him."""
    steady = time.monotonic()
    limit, found = steady + MATCH_TIMEOUT_S, player.matched()
    while (now := time.monotonic()) < limit:
        if (counts := player.matched()) != found:
            found, steady = counts, now
        is_complete = all(connected >= known for connected, known in found)
        if is_complete and now >= max(steady + STEADY_S, earliest):
            return
        comparing.pause(TICK_S)


def play_once(
    comparing: Comparing, player: Replay, recording: Recording, setting: Setting, from_ns: int
) -> None:
    """Play a recording from a bag time to its end, the simulator beside it, and compare."""
    link = comparing.link
    rate = comparing.settings.rate
    link.start(request_of(setting, rate, link.listener))
    comparing.say(f'replaying {player.n_messages} messages')
    comparing.note_measured(player.begin(from_ns))
    first, _ = span_of(setting)
    length = comparing.window_s(setting)
    schedule = ends(first, length)
    end = next(schedule)
    rows, since = 0, time.monotonic()
    while not (link.is_complete and player.is_done):
        link.poll()
        # both clocks begin with the recording; the run begins LEAD_S before it
        now_s = link.time_s - LEAD_S
        played = player.finish() if link.is_complete else player.play(now_s)
        comparing.note_measured(played)
        if now_s >= end + LEAD_S:
            comparing.compare_later(recording, setting, end - length, end)
            end = next(schedule)
        comparing.publish_ready()
        if link.run.n_rows > rows:
            rows, since = link.run.n_rows, time.monotonic()
        elif time.monotonic() - since > PATIENCE_S:
            since = time.monotonic()
            link.complain()
        comparing.pause(TICK_S)
    for topic in player.not_taken(TAKEN_WITHIN_S):
        comparing.node.get_logger().warning(f'{topic}: a subscriber has not taken all of it')
    comparing.conclude(recording, setting)
