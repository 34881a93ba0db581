"""Repair in memory what can be repaired without a guess; every repair is named."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from escalator_twin.check.gaps import STILL
from escalator_twin.check.parts import own_noise
from escalator_twin.check.quality import is_beside
from escalator_twin.check.spikes import outliers
from escalator_twin.check.still import stands_still
from escalator_twin.machine import Machine, Sensor
from escalator_twin.signals import Finding, Floats, read_only, Recording, Signal

DEAD_NOISE = 3.0  # a part that moves by less than this many times its noise while others live
LIVE_NOISE = 12.0  # the others then move by more than this
# Of a channel's samples: fewer that move are as good as none. An argument: of the shortest recording that is judged,
# a loop of a minute, it is six seconds.
LEAST_ALIVE = 0.1
MENDED = ('sensor_spikes', 'gauge_dead')  # in this order: a mean is taken of mended parts


def mend(
    recording: Recording, machine: Machine, findings: list[Finding]
) -> tuple[Recording, list[Finding]]:
    """Bridge isolated outliers, leave out dead parts of a channel, and what of it stands still.

    A channel that nearly always stands still is left out as a whole.

    Parameters
    ----------
    recording : Recording
    machine : Machine
    findings : list of Finding
        From ``check``; those that were mended come back with ``repaired`` set.

    Returns
    -------
    recording : Recording
        With new signals where something was mended.
    findings : list of Finding
    """
    wanted = {(f.kind, f.channel) for f in findings if f.kind in MENDED}
    signals = dict(recording.signals)
    done: dict[tuple[str, str], float] = {}
    for kind, channel in sorted(wanted, key=lambda one: (MENDED.index(one[0]), one[1])):
        if channel not in signals:
            continue
        sensor = machine.instruments.sensor(channel)
        noise, mended = 1.0, None
        if kind == 'sensor_spikes':
            mended = _without_spikes(recording, machine, sensor, signals[channel])
        else:
            living = _without_dead(signals[channel], sensor)
            if living is not None:
                mended, noise = living
        if mended is not None:
            signals[channel] = mended
            done[kind, channel] = noise
    signals, still = _without_still(signals, machine, findings)
    if not done and not still:
        return recording, findings
    told = []
    for f in findings:
        if (f.kind, f.channel) in done:
            f = replace(f, repaired=True, noise=done[f.kind, f.channel])
        elif f.channel in still and _is_still(f):
            f = replace(f, repaired=True)
        told.append(f)
    return replace(recording, signals=signals), told


def _noise(part: Floats, sensor: Sensor) -> float:
    """Return one standard deviation of a part's noise, by the description or its own."""
    return sensor.noise * abs(sensor.scale) or own_noise(part)


def _with_parts(signal: Signal, parts: Floats, values: Floats) -> Signal:
    return replace(signal, parts=read_only(parts), values=read_only(values))


def _without_spikes(
    recording: Recording, machine: Machine, sensor: Sensor, signal: Signal
) -> Signal | None:
    """Put straight lines where ``check`` finds outliers; a machine's impacts stay."""
    others = [
        (recording.signals[other.channel], other)
        for other in machine.instruments.sensors
        if other.channel in recording.signals and is_beside(other, sensor)
    ]
    mask = outliers(recording.signals[sensor.channel], sensor, others)
    parts, index, is_mended = np.array(signal.parts), np.arange(len(signal.parts)), False
    for k, hit in enumerate(mask):
        if hit.any() and not hit.all():
            parts[hit, k] = np.interp(index[hit], index[~hit], parts[~hit, k])
            is_mended = True
    return _with_parts(signal, parts, parts.mean(axis=1)) if is_mended else None


def _without_still(
    signals: Mapping[str, Signal], machine: Machine, findings: Sequence[Finding]
) -> tuple[dict[str, Signal], list[str]]:
    """Return signals without the samples at which their channel reads a constant; also which were mended.

    They become a gap. The first and the last sample stay: a channel is as long as it was recorded.
    """
    left = dict(signals)
    told = {f.channel for f in findings if _is_still(f)}
    mended: list[str] = []
    for channel in sorted(told & set(signals)):
        signal = signals[channel]
        moves = ~stands_still(signal, machine.instruments.sensor(channel))
        if moves.all():  # it was an outlier's neighbours that stood still
            continue
        mended.append(channel)
        if moves.mean() < LEAST_ALIVE:
            del left[channel]
            continue
        moves[[0, -1]] = True
        left[channel] = signal.only(moves)
    return left, mended


def _is_still(finding: Finding) -> bool:
    return finding.kind == 'data_gap' and finding.detail.startswith(STILL)


def _without_dead(signal: Signal, sensor: Sensor) -> tuple[Signal, float] | None:
    """Take the axial part from the parts that live; also return the noise of it, times that of all parts' mean."""
    parts = signal.parts
    n = parts.shape[1]
    moves = np.array([float(np.std(parts[:, k])) for k in range(n)])
    noise = np.array([_noise(parts[:, k], sensor) for k in range(n)])
    dead = moves < DEAD_NOISE * noise
    still = np.array([np.mean(np.diff(parts[:, k]) == 0.0) > 0.9 for k in range(n)])
    dead |= still
    if not dead.any() or dead.all() or moves[~dead].min() < LIVE_NOISE * noise.max():
        return None
    weights = axial_weights(sensor, ~dead)
    if weights is None:
        return None
    values = parts[:, ~dead] @ weights
    return _with_parts(signal, parts, values), float(np.sqrt(n * (weights @ weights)))


def axial_weights(sensor: Sensor, live: np.ndarray) -> Floats | None:
    """Return what the living parts weigh so that bending cancels, up and down and between the faces.

    Three of four gauges tell both bendings and the axial part, each in one way alone. Where the faces cannot be
    told apart any more, the bending up and down alone is cancelled; None where that is not possible either.

    Parameters
    ----------
    sensor : Sensor
    live : (n,) bool
    """
    n = len(live)
    signs = [row for row in (sensor.bending, sensor.faces) if len(row) == n]
    for count in range(len(signs), min(len(signs), 1) - 1, -1):
        rows = np.array([np.ones(n), *signs[:count]])[:, live]
        wanted = np.eye(len(rows))[0]
        weights: Floats = np.linalg.pinv(rows) @ wanted  # of all that do, the least noise
        if np.allclose(rows @ weights, wanted, atol=1e-9):
            return weights
    return None
