"""Put the channels of a recording on one time axis and on even grids."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from escalator_twin.errors import RecordingError
from escalator_twin.machine import Machine
from escalator_twin.signals import Floats, Recording, Signal

GAP_STEPS = 1.5  # a grid point farther than this from any sample is a gap
# Between samples farther apart than one, one or two are lost, and a cubic bridges them: of 13 Hz at 200 Hz a straight
# line is off by 2 % in the middle of one lost sample, the cubic by less than 0.1 %.
LOST_STEPS = (1.5, 3.5)


@dataclass(frozen=True)
class Clock:
    """A logger's clock against the reference: ``reference = t - offset - rate * (t - origin)``.

    Attributes
    ----------
    offset_s : float
        Clock minus reference at the origin, s.
    rate : float
        How much faster it runs, s/s.
    """

    offset_s: float = 0.0
    rate: float = 0.0


@dataclass(frozen=True)
class Timed:
    """One channel on an even grid of its logger's clock, told in reference time.

    Attributes
    ----------
    channel : str
    time_s : (n,) float64
        Reference (ground) time since the recording's origin, s.
    values : (n,) float64
        SI; a cubic where one or two samples are lost, else linear.
    valid : (n,) bool
        False inside gaps.
    rate_hz : float
    """

    channel: str
    time_s: Floats
    values: Floats
    valid: NDArray[np.bool_]
    rate_hz: float


def origin_ns(recording: Recording, machine: Machine) -> int:
    """Return time zero of the reference clock: its logger's first stamp, or else any first.

    Raises
    ------
    RecordingError
        Where no channel has samples.
    """
    starts = {c: int(s.stamp_ns[0]) for c, s in recording.signals.items() if len(s.stamp_ns)}
    if not starts:
        raise RecordingError(f'{recording.path}: no samples on any topic of the machine')
    reference = machine.instruments.channels_of(machine.instruments.reference_logger)
    return min([t for c, t in starts.items() if c in reference] or starts.values())


def time_one(signal: Signal, rate_hz: float, origin: int, clock: Clock) -> Timed:
    """Resample one signal onto its even grid and tell its time in reference seconds.

    Parameters
    ----------
    signal : Signal
    rate_hz : float
        The instrument's rate.
    origin : int
        Time zero, ns of the reference clock.
    clock : Clock
        Of the signal's logger; its own origin is the same ``origin``.

    Raises
    ------
    RecordingError
        Where the signal has fewer than two samples.
    """
    if len(signal.stamp_ns) < 2:
        raise RecordingError(f'{signal.channel}: expected samples, found {len(signal.stamp_ns)}')
    own = (signal.stamp_ns - signal.stamp_ns[0]) * 1e-9
    n = int(np.floor(own[-1] * rate_hz + 0.5)) + 1
    grid = np.arange(n) / rate_hz
    values = np.interp(grid, own, signal.values)
    after = np.clip(np.searchsorted(own, grid), 1, len(own) - 1)
    apart = own[after] - own[after - 1]
    lost = (apart > LOST_STEPS[0] / rate_hz) & (apart < LOST_STEPS[1] / rate_hz)
    if lost.any():
        values[lost] = CubicSpline(own, signal.values)(grid[lost])
    distance = np.minimum(np.abs(grid - own[after - 1]), np.abs(own[after] - grid))
    since = grid + (int(signal.stamp_ns[0]) - origin) * 1e-9
    time = since - clock.offset_s - clock.rate * (since - clock.offset_s)
    return Timed(signal.channel, time, values, distance <= GAP_STEPS / rate_hz, rate_hz)


def time_all(
    recording: Recording, machine: Machine, clocks: Mapping[str, Clock], origin: int
) -> dict[str, Timed]:
    """Return the tracks of all channels that have samples, in the machine's order."""
    tracks = {}
    for sensor in machine.instruments.sensors:
        signal = recording.signals.get(sensor.channel)
        if signal is not None and len(signal.stamp_ns) > 1:
            clock = clocks.get(sensor.logger, Clock())
            tracks[sensor.channel] = time_one(signal, sensor.rate_hz, origin, clock)
    return tracks
