"""The standstill before and after a run, which is no part of what is compared."""

from collections.abc import Mapping
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from escalator_twin.check.parts import own_noise
from escalator_twin.machine import Machine, Sensor
from escalator_twin.signals import Finding, Floats, Recording, Signal

WINDOW_S = 1.0  # of which the movement is told: nearly a link's at 0.5 m/s
LEAST_S = 2.0  # that a standstill lasts
# Movement, noise taken as it is, of the upper quartile of all windows. An argument: a machine at rest has its noise, a
# tenth of what it moves by, and no machine that runs has a quarter in all channels at once, at two seconds' length.
STILL_SHARE = 0.25
# Of a channel's noise: one that moves by less says nothing.
LEAST_MOVED = 5.0
RAMP_S = 3.0  # also left out: no speed is set while it starts or stops
LEAST_CHANNELS = 2


def without_standstill(recording: Recording, machine: Machine) -> tuple[Recording, list[Finding]]:
    """Leave out what was recorded before the machine ran and after, with its start and its stop.

    Parameters
    ----------
    recording : Recording
    machine : Machine

    Returns
    -------
    recording : Recording
        As it was where it runs all the time.
    findings : list of Finding
        ``data_gap`` of no channel, repaired: what was left out.
    """
    signals = {c: s for c, s in recording.signals.items() if len(s.bag_ns) > 1}
    if not signals:
        return recording, []
    first = min(int(s.bag_ns[0]) for s in signals.values())
    end_s = max((int(s.bag_ns[-1]) - first) * 1e-9 for s in signals.values())
    still = _still(signals, machine, first, end_s)
    begin, end = _run(still, end_s)
    findings = [
        Finding(
            'data_gap', '', a, b, f'the machine {what}, {b - a:.1f} s: left out', repaired=True
        )
        for a, b, what in ((0.0, begin, 'stands and starts'), (end, end_s, 'stops and stands'))
        if b > a
    ]
    if not findings or begin >= end:
        return recording, []
    cut = {c: _between(s, first, begin, end) for c, s in recording.signals.items()}
    return Recording(recording.path, cut, recording.experiment, recording.findings), findings


def _still(
    signals: Mapping[str, Signal], machine: Machine, first: int, end_s: float
) -> NDArray[np.bool_]:
    """Tell of each window whether all channels that tell a movement have none, (windows,)."""
    windows = int(end_s / WINDOW_S)
    shares = []
    for channel, signal in signals.items():
        moved = _movement(signal, first, windows)
        known = moved[np.isfinite(moved)]
        if not len(known):
            continue
        level = float(np.quantile(known, 0.75))
        if level > LEAST_MOVED * _noise(signal, machine.instruments.sensor(channel)):
            shares.append(np.nan_to_num(moved / level))  # what is not there says nothing
    if windows < 1 or len(shares) < LEAST_CHANNELS:
        return np.zeros(max(windows, 0), bool)
    found: NDArray[np.bool_] = np.max(shares, axis=0) < STILL_SHARE
    return found


def _noise(signal: Signal, sensor: Sensor) -> float:
    """Return one standard deviation of a channel's noise, by the description or its own."""
    n = max(signal.parts.shape[1], 1)
    return sensor.noise * abs(sensor.scale) / np.sqrt(n) or own_noise(signal.values)


def _movement(signal: Signal, first: int, windows: int) -> Floats:
    """Return the standard deviation about a straight line in each window, NaN where there are no samples."""
    time = (signal.bag_ns - first) * 1e-9
    edges = np.searchsorted(time, WINDOW_S * np.arange(windows + 1))
    found = np.full(windows, np.nan)
    for k, (a, b) in enumerate(pairwise(edges)):
        if b - a > 3:
            line = np.stack([time[a:b] - time[a], np.ones(b - a)], axis=1)
            values = signal.values[a:b]
            found[k] = np.std(values - line @ np.linalg.lstsq(line, values, rcond=None)[0])
    return found


def _run(still: NDArray[np.bool_], end_s: float) -> tuple[float, float]:
    """Return from when to when the machine runs, s."""
    moves = np.flatnonzero(~still)
    if not len(moves):
        return 0.0, end_s
    before, after = moves[0] * WINDOW_S, (len(still) - 1 - moves[-1]) * WINDOW_S
    begin = before + RAMP_S if before >= LEAST_S else 0.0
    end = (moves[-1] + 1) * WINDOW_S - RAMP_S if after >= LEAST_S else end_s
    return float(begin), float(end)


def _between(signal: Signal, first: int, begin: float, end: float) -> Signal:
    """Return the part of a signal between two bag times, s from ``first``."""
    time = (signal.bag_ns - first) * 1e-9
    return signal.only((time >= begin) & (time <= end))
