"""Faults of sensors that show in their own signal: still, dead, clipped, spiky, humming."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from escalator_twin.check.gaps import longest_live_run, still_runs
from escalator_twin.machine import Sensor
from escalator_twin.signals import Finding, Floats, Signal

# A sample further outside the range of its neighbours than this many times that range is a spike:
# the sharpest impact of a roller, which rings, reaches 2.4 times.
SPIKE_RANGE = 3.0
SPIKE_NEIGHBOURS = 4
# ... and by this many standard deviations of the noise: force signals reach 7.6 by impacts.
SPIKE_NOISE = 10.0
MAINS_HZ = (50.0, 60.0)
MAINS_WIDTH_HZ = 0.5  # mains and loggers' clocks are off by 0.2 Hz at most
# Amplitude from which a mains tone counts, in standard deviations of a field's noise: 3e-7 strain
# of the prototype's gauges, three tolerances.
HUM_NOISE = 1.2
# ... and over the strongest line within 5 Hz beside it: a tone of the mains is one line.
HUM_LINE = 8.0
# A live pair of gauges differs by its gain error and lateral bending, together below 20 %.
TWIN_SLOPE = (0.5, 2.0)
# A gauge that moves by less than this many times its noise where its twin moves is dead.
DEAD_NOISE = 3.0
# Samples piled up at an extreme against the fullest of the next bins.
CLIP_COUNT = 20
CLIP_RATIO = 4.0
CLIP_BINS = 5


class Part(NamedTuple):
    """One field of a sensor, in the field's own unit scaled to the channel's."""

    values: Floats
    noise: float
    resolution: float


def parts_of(signal: Signal, sensor: Sensor) -> list[Part]:
    """Return a channel's fields with their noise in the channel's unit.

    Where the description gives no noise, that of the signal's second differences is taken.
    """
    parts = []
    for k in range(signal.parts.shape[1]):
        values = np.ascontiguousarray(signal.parts[:, k])
        noise = sensor.noise * abs(sensor.scale)
        parts.append(
            Part(values, noise or own_noise(values), sensor.resolution * abs(sensor.scale))
        )
    return parts


def own_noise(values: Floats) -> float:
    """Return the noise of a signal by its second differences, robust against what happens."""
    if len(values) < 5:
        return 0.0
    # white noise of sigma has second differences of sqrt(6) sigma
    second = np.diff(values, 2)
    return float(1.4826 * np.median(np.abs(second)) / np.sqrt(6.0))


def stillness(signal: Signal, sensor: Sensor, time_s: Floats) -> list[Finding]:
    """Find where a channel, or one of its gauges, reads a constant."""
    parts = parts_of(signal, sensor)
    n = len(signal.values)
    findings = []
    is_still = np.zeros((len(parts), n), dtype=bool)
    for k, part in enumerate(parts):
        if part.noise <= 0.0 or (sensor.noise > 0.0 and _is_ideal(part)):
            continue  # without noise a slow signal may well repeat itself
        for begin, end in still_runs(
            part.values, longest_live_run(part.noise, part.resolution, n)
        ):
            is_still[k, begin : end + 1] = True
    all_still: NDArray[np.bool_] = np.asarray(is_still.all(axis=0))
    for begin, end in _spans(all_still):
        text = f'the value stands still for {time_s[end] - time_s[begin]:.2f} s'
        findings.append(_finding('data_gap', signal, time_s, begin, end, text))
    for k in range(len(parts) if len(parts) > 1 else 0):
        spans = _spans(is_still[k] & ~all_still)
        if spans:
            value = parts[k].values[spans[0][0]]
            text = f'part {k + 1} of {len(parts)} reads a constant ({_field(value, sensor):.4g})'
            begin, end = spans[0][0], spans[-1][1]
            findings.append(_finding('gauge_dead', signal, time_s, begin, end, text))
    return findings


def _is_ideal(part: Part) -> bool:
    """Tell whether a signal has less noise than its sensor could: then it is a simulation's."""
    changing = part.values[np.flatnonzero(np.diff(part.values))]
    return len(changing) > 100 and own_noise(changing) < 0.2 * part.noise


def twins(signal: Signal, sensor: Sensor, time_s: Floats) -> list[Finding]:
    """Find gauges that do not follow the one that should read alike (same sign of bending)."""
    findings = []
    parts = parts_of(signal, sensor)
    for i in range(len(sensor.bending)):
        for j in range(i + 1, min(len(sensor.bending), len(parts))):
            if sensor.bending[i] != sensor.bending[j]:
                continue
            dead = _dead_twin(parts[i], parts[j])
            if dead is not None:
                k, other = (i, j) if dead == 0 else (j, i)
                if np.ptp(parts[k].values) == 0.0:
                    continue  # told as a constant
                text = f'part {k + 1} of {len(parts)} does not follow part {other + 1}'
                end = len(time_s) - 1
                findings.append(_finding('gauge_dead', signal, time_s, 0, end, text))
    return findings


def _dead_twin(a: Part, b: Part) -> int | None:
    """Return which of two gauges that should read alike is dead (0 or 1), if one is."""
    moves = [float(np.std(part.values)) for part in (a, b)]
    dead = int(moves[1] < moves[0])
    quiet, live = moves[dead], moves[1 - dead]
    if live < 2.0 * DEAD_NOISE * max(a.noise, b.noise):
        return None  # nothing moves enough to tell
    covariance = float(np.cov(a.values, b.values)[0, 1])
    slope = covariance / live**2
    if quiet < DEAD_NOISE * max(a.noise, b.noise) or not (TWIN_SLOPE[0] < slope < TWIN_SLOPE[1]):
        return dead
    return None


def saturation(signal: Signal, sensor: Sensor, time_s: Floats) -> list[Finding]:
    """Find samples piled up at the largest or smallest value."""
    findings = []
    parts = parts_of(signal, sensor)
    for k, part in enumerate(parts):
        for sign, name in ((1.0, 'largest'), (-1.0, 'smallest')):
            hit = _clipped(sign * part.values)
            if hit is None:
                continue
            which = f'part {k + 1} of {len(parts)}: ' if len(parts) > 1 else ''
            value = _field(sign * float((sign * part.values).max()), sensor)
            text = f'{which}{len(hit)} samples at the {name} value, {value:.5g}'
            findings.append(
                _finding('saturation', signal, time_s, int(hit[0]), int(hit[-1]), text)
            )
    return findings


def _clipped(values: Floats) -> NDArray[np.int64] | None:
    """Return the samples at the maximum where they are piled up there, else ``None``."""
    top = values.max()
    hit = np.flatnonzero(values == top)
    if len(hit) < CLIP_COUNT or len(hit) == len(values) or np.ptp(hit) + 1 == len(hit):
        return None  # one run alone stands still
    counts = np.unique(values[values > np.quantile(values, 0.5)], return_counts=True)[1]
    below = counts[-1 - CLIP_BINS : -1]
    if len(below) and len(hit) < CLIP_RATIO * below.max():
        return None
    return hit


def spikes(signal: Signal, sensor: Sensor, time_s: Floats) -> list[Finding]:
    """Find isolated outliers: single samples far outside the range of those around them."""
    hit = np.zeros(len(signal.values), dtype=bool)
    for part in parts_of(signal, sensor):
        hit |= spike_mask(part.values, max(part.noise, part.resolution / np.sqrt(12.0)))
    n = int(hit.sum())
    if not n:
        return []
    where = np.flatnonzero(hit)
    size = float(np.abs(_beyond(signal.values)[where]).max())
    text = f'{n} isolated outliers, the largest of {size:.3g} {signal.unit}'
    return [_finding('sensor_spikes', signal, time_s, int(where[0]), int(where[-1]), text)]


def _beyond(values: Floats) -> Floats:
    """Return each sample's distance from the median of its neighbours, 0 at the ends."""
    h = SPIKE_NEIGHBOURS
    result = np.zeros(len(values))
    if len(values) > 2 * h:
        result[h:-h] = values[h:-h] - np.median(_neighbours(values), axis=0)
    return result


def _neighbours(values: Floats) -> Floats:
    """Return the values around each sample but the first and last, (2 h, n - 2 h)."""
    h, n = SPIKE_NEIGHBOURS, len(values)
    return np.stack([values[h + k : n - h + k] for k in range(-h, h + 1) if k])


def spike_mask(values: Floats, noise: float) -> NDArray[np.bool_]:
    """Tell of each sample whether it is a spike; ``noise`` is one standard deviation."""
    hit = np.zeros(len(values), dtype=bool)
    h = SPIKE_NEIGHBOURS
    if len(values) <= 2 * h or noise <= 0.0:
        return hit
    around = _neighbours(values)
    low, high = around.min(axis=0), around.max(axis=0)
    middle = values[h:-h]
    over = np.maximum(middle - high, low - middle)
    # a quiet neighbourhood has a range of its noise: 2.8 sigma for eight samples
    hit[h:-h] = (over > SPIKE_RANGE * (high - low)) & (over > SPIKE_NOISE * noise)
    return hit


def hum(signal: Signal, sensor: Sensor, time_s: Floats) -> list[Finding]:
    """Find a tone of the mains, or what sampling makes of it."""
    tones = [tone for part in parts_of(signal, sensor) if (tone := _tone(part, time_s))]
    if not tones:
        return []
    frequency, amplitude, mains = max(tones, key=lambda tone: tone[1])
    text = (
        f'a tone of {_field(amplitude, sensor):.3g} (amplitude of a field) at {frequency:.2f} Hz: '
        f'mains of {mains:g} Hz'
    )
    return [_finding('mains_hum', signal, time_s, 0, len(time_s) - 1, text)]


def _tone(part: Part, time_s: Floats) -> tuple[float, float, float] | None:
    """Return frequency, amplitude and mains frequency of the strongest mains tone, if any."""
    n = len(part.values)
    if n < 256 or part.noise <= 0.0:
        return None
    rate = 1.0 / float(np.median(np.diff(time_s)))
    grid = time_s[0] + np.arange(int((time_s[-1] - time_s[0]) * rate)) / rate
    values = np.interp(grid, time_s, part.values)
    window = np.hanning(len(values))
    spectrum = 2.0 * np.abs(np.fft.rfft((values - values.mean()) * window)) / window.sum()
    frequency = np.fft.rfftfreq(len(values), 1.0 / rate)
    best = None
    for mains in MAINS_HZ:
        alias = abs(mains - rate * round(mains / rate))
        is_near = np.abs(frequency - alias) < MAINS_WIDTH_HZ
        is_beside = (np.abs(frequency - alias) < 10.0 * MAINS_WIDTH_HZ) & ~is_near
        if alias < 2.0 * MAINS_WIDTH_HZ or not is_near.any() or not is_beside.any():
            continue  # an alias this low is hidden in the motion
        peak = int(np.argmax(np.where(is_near, spectrum, 0.0)))
        amplitude = float(spectrum[peak])
        if amplitude < max(HUM_NOISE * part.noise, HUM_LINE * float(spectrum[is_beside].max())):
            continue
        if best is None or amplitude > best[1]:
            best = (float(frequency[peak]), amplitude, mains)
    return best


def _spans(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return begin and end (inclusive) of the runs of True."""
    change = np.diff(np.concatenate([[0], mask.astype(np.int8), [0]]))
    begins, ends = np.flatnonzero(change == 1), np.flatnonzero(change == -1) - 1
    return [(int(b), int(e)) for b, e in zip(begins, ends, strict=True)]


def _field(value: float, sensor: Sensor) -> float:
    """Return a channel's value, or amplitude, in its field's own unit."""
    return value / abs(sensor.scale)


def _finding(
    kind: str, signal: Signal, time_s: Floats, begin: int, end: int, text: str
) -> Finding:
    return Finding(kind, signal.channel, float(time_s[begin]), float(time_s[end]), text)
