"""The comparator with a bag: replay it in step with the simulator and compare."""

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
MATCH_TIMEOUT_S = 5.0  # for subscribers of the measured topics to be found


def replay(comparing: Comparing, player: Replay) -> None:
    """Place the recording that the settings name in the loop; play it as often as asked for."""
    settings = comparing.settings
    comparing.say(f'reading {settings.bag}')
    recording = bagfile.read(settings.bag, comparing.machine)
    from_ns = player.first_ns + round(settings.start_offset_s * NS)
    if settings.start_offset_s:
        recording = without_start(recording, from_ns)
    comparing.say('finding speed and place in the loop')
    setting = locate(recording, comparing.machine)
    experiment = setting.experiment
    comparing.say(
        f'{experiment.set_speed_m_s:.5f} m/s, axle 0 at {setting.start_s_m:.3f} m: '
        f'waiting for the simulator'
    )
    comparing.tell_quality(setting)
    comparing.note_simulated(recorder_shift_ns(recording, setting.origin_ns))
    limit = time.monotonic() + MATCH_TIMEOUT_S
    while not player.is_matched() and time.monotonic() < limit:
        comparing.pause(TICK_S)
    play_once(comparing, player, recording, setting, from_ns)
    while settings.loop:
        play_once(comparing, player, recording, setting, from_ns)


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
    comparing.conclude(recording, setting)
