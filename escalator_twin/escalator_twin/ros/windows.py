"""Parts of a comparison: the recording up to a time, the last window of it, its schedule."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from escalator_twin.comparison.locate import LEAD_S, Setting
from escalator_twin.machine import Machine
from escalator_twin.signals import Recording
from escalator_twin.sync.timeline import Timed

EDGE_S = 2.0  # of a window, on either side, that scores leave out (contracts: whole loops)


def window_s(asked_s: float, machine: Machine, speed_m_s: float) -> float:
    """Return the length of a window: what is asked for, or one whole loop and its edges."""
    loop_m = machine.chain.n_links * machine.chain.pitch_m
    return asked_s or loop_m / speed_m_s + 2.0 * EDGE_S


def ends(first_s: float, length_s: float) -> Iterator[float]:
    """Yield the times at which windows are complete, one after the other."""
    end = first_s + length_s
    while True:
        yield end
        end += length_s


def cut_setting(setting: Setting, from_s: float, to_s: float) -> Setting:
    """Return a setting whose channels hold the samples between two reference times."""
    tracks = {}
    for channel, track in setting.tracks.items():
        kept = (track.time_s >= from_s) & (track.time_s <= to_s)
        tracks[channel] = Timed(
            channel,
            track.time_s[kept],
            track.values[kept],
            track.valid[kept],
            track.rate_hz,
        )
    return replace(setting, tracks=tracks)


def run_needed_s(setting: Setting, to_s: float) -> float:
    """Return how long the twin has to run to come where the machine was at a time.

    The twin keeps the speed that it was started with, the machine wanders about it.
    """
    travel_m = float(setting.travel.at(np.array([to_s]))[0])
    return travel_m / setting.experiment.set_speed_m_s + LEAD_S


def span_of(setting: Setting) -> tuple[float, float]:
    """Return the reference times of the first and the last sample."""
    return (
        min(float(track.time_s[0]) for track in setting.tracks.values()),
        max(float(track.time_s[-1]) for track in setting.tracks.values()),
    )


def recorder_shift_ns(recording: Recording, origin_ns: int) -> int:
    """Return the recorder's time less the reference clock's, at the sample that is the origin.

    Not always the first one: a standstill before the run is left out.
    """
    for signal in recording.signals.values():
        k = int(np.searchsorted(signal.stamp_ns, origin_ns))
        if k < len(signal.stamp_ns) and int(signal.stamp_ns[k]) == origin_ns:
            return int(signal.bag_ns[k]) - origin_ns
    return 0


def without_start(recording: Recording, from_bag_ns: int) -> Recording:
    """Return a recording without what came before a bag time."""
    return replace(
        recording,
        signals={
            channel: signal.only(signal.bag_ns >= from_bag_ns)
            for channel, signal in recording.signals.items()
        },
    )
