"""Faults of sensors that show in their own signal: still, dead, clipped, spiky, humming."""

from collections.abc import Sequence
import itertools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from escalator_twin.check.gaps import longest_live_run, share_of_repeats, STILL, still_runs
from escalator_twin.machine import Sensor
from escalator_twin.signals import Finding, Floats, Signal

# A sample further outside the range of its neighbours than this many times that range is a spike:
# of a roller's impacts, which ring for the next samples, one in a million does so.
SPIKE_RANGE = 2.0
SPIKE_NEIGHBOURS = 6
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
FINEST = 0.01  # of a signal's changes: noise without a resolution changes by a sixtieth of itself
MIN_CHANGES = 100  # that say so: fewer may be outliers of a dead channel
HELD_S = 2.0  # a value that stands longer says nothing of how a live channel repeats
MIN_LIVE = 1000  # samples of two gauges side by side that a judgement needs
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

    Where the description gives no noise, that of the signal's second differences is taken; where the signal
    is coarser than described, its own resolution.
    """
    parts = []
    for k in range(signal.parts.shape[1]):
        values = np.ascontiguousarray(signal.parts[:, k])
        noise = sensor.noise * abs(sensor.scale)
        resolution = max(sensor.resolution * abs(sensor.scale), own_resolution(values))
        parts.append(Part(values, noise or own_noise(values), resolution))
    return parts


def own_resolution(values: Floats) -> float:
    """Return by how little a signal ever changes: its resolution, where that is coarse beside its noise."""
    changes = np.abs(np.diff(values))
    changes = changes[changes > 0.0]
    return float(np.quantile(changes, FINEST)) if len(changes) >= MIN_CHANGES else 0.0


def is_coarse(part: Part) -> bool:
    """Tell whether a signal's noise does not move it from one step of its resolution to the next.

    How long it stands on one says how slow it is there, and nothing of whether it lives.
    """
    return part.resolution > part.noise * float(np.sqrt(2.0 * np.pi))


def own_noise(values: Floats) -> float:
    """Return the noise of a signal by its second differences, robust against what happens."""
    if len(values) < 5:
        return 0.0
    # white noise of sigma has second differences of sqrt(6) sigma
    second = np.diff(values, 2)
    return float(1.4826 * np.median(np.abs(second)) / np.sqrt(6.0))


def stillness(signal: Signal, sensor: Sensor, time_s: Floats) -> list[Finding]:
    """Find where a channel reads a constant, and gauges that read one or do not follow."""
    parts = parts_of(signal, sensor)
    is_still = _still_parts(parts, sensor)
    all_still: NDArray[np.bool_] = np.asarray(is_still.all(axis=0))
    findings = []
    for begin, end in _spans(all_still):
        text = f'{STILL} for {time_s[end] - time_s[begin]:.2f} s'
        findings.append(_finding('data_gap', signal, time_s, begin, end, text))
    if len(parts) > 1:
        for k, part in enumerate(parts):
            # where the whole channel stands still, one part may have read that value a sample before
            spans = _spans(is_still[k] & ~all_still)
            spans = [(a, b) for a, b in spans if b - a + 1 > _longest(part, sensor)]
            if spans:
                value = _field(part.values[spans[0][0]], sensor)
                text = f'part {k + 1} of {len(parts)} reads a constant ({value:.4g})'
                begin, end = spans[0][0], spans[-1][1]
                findings.append(_finding('gauge_dead', signal, time_s, begin, end, text))
        findings += _twins(signal, sensor, time_s, is_still)
    return findings


def stands_still(signal: Signal, sensor: Sensor) -> NDArray[np.bool_]:
    """Tell of each sample whether the whole channel reads a constant there, (n,)."""
    found: NDArray[np.bool_] = np.asarray(
        _still_parts(parts_of(signal, sensor), sensor).all(axis=0)
    )
    return found


def _still_parts(parts: Sequence[Part], sensor: Sensor) -> NDArray[np.bool_]:
    """Tell of each sample of each part whether it stands still, (parts, n)."""
    return np.stack([_still(part, sensor) for part in parts])


def _still(part: Part, sensor: Sensor) -> NDArray[np.bool_]:
    """Tell of each sample whether it belongs to a run that live noise does not give."""
    mask = np.zeros(len(part.values), dtype=bool)
    if part.noise <= 0.0 or (sensor.noise > 0.0 and _is_ideal(part)):
        return mask  # without noise a slow signal may well repeat itself
    runs = still_runs(part.values, _longest(part, sensor))
    for extreme in (part.values.min(), part.values.max()):
        at_extreme = [run for run in runs if part.values[run[0]] == extreme]
        if len(at_extreme) > 1:  # clipped there again and again: saturation
            runs = [run for run in runs if run not in at_extreme]
    for begin, end in runs:
        mask[begin : end + 1] = True
    return mask


def _longest(part: Part, sensor: Sensor) -> int:
    """Return how many equal values in a row live noise may give."""
    if is_coarse(part):
        return len(part.values) // 2
    repeats = share_of_repeats(part.values, round(HELD_S * sensor.rate_hz))
    return longest_live_run(part.noise, part.resolution, len(part.values), repeats)


def _is_ideal(part: Part) -> bool:
    """Tell whether a signal has less noise than its sensor could: then it is a simulation's."""
    changing = part.values[np.flatnonzero(np.diff(part.values))]
    return len(changing) > 100 and own_noise(changing) < 0.2 * part.noise


def _twins(
    signal: Signal, sensor: Sensor, time_s: Floats, is_still: NDArray[np.bool_]
) -> list[Finding]:
    """Find gauges that do not follow the one that should read alike (same sign of bending)."""
    findings = []
    parts = parts_of(signal, sensor)
    n = min(len(sensor.bending), len(parts))
    for i, j in itertools.combinations(range(n), 2):
        live = ~(is_still[i] | is_still[j])
        if sensor.bending[i] != sensor.bending[j] or live.sum() < MIN_LIVE:
            continue
        dead = _dead_twin(*(parts[k]._replace(values=parts[k].values[live]) for k in (i, j)))
        if dead is not None:
            k, other = (i, j) if dead == 0 else (j, i)
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
    slope = float(np.cov(a.values, b.values)[0, 1]) / live**2
    follows = TWIN_SLOPE[0] < slope < TWIN_SLOPE[1]
    return dead if quiet < DEAD_NOISE * max(a.noise, b.noise) or not follows else None


def saturation(signal: Signal, sensor: Sensor, time_s: Floats) -> list[Finding]:
    """Find samples piled up at the largest or smallest value."""
    findings = []
    parts = parts_of(signal, sensor)
    for k, part in enumerate(parts):
        for sign, name in ((1.0, 'largest'), (-1.0, 'smallest')):
            hit = None if is_coarse(part) else _clipped(sign * part.values)
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


def neighbourhood(values: Floats, where: NDArray[np.int64]) -> tuple[Floats, Floats]:
    """Return the samples at ``where``, and those around them, less the slope of those around.

    The slope is the median of the differences between neighbours: what rings keeps its range.

    Returns
    -------
    middle : (n,)
        Distance from the median of the samples around.
    around : (2 h, n)
        Theirs.
    """
    h = SPIKE_NEIGHBOURS
    steps = np.array([k for k in range(-h, h + 1) if k])
    around = values[where + steps[:, None]]
    sides = np.concatenate([np.diff(around[:h], axis=0), np.diff(around[h:], axis=0)])
    around -= steps[:, None] * np.median(sides, axis=0)
    level = np.median(around, axis=0)
    return values[where] - level, around - level


def spike_mask(values: Floats, noise: float, ranges: float = SPIKE_RANGE) -> NDArray[np.bool_]:
    """Tell of each sample whether it is a spike.

    Parameters
    ----------
    values : (n,) float64
    noise : float
        One standard deviation.
    ranges : float, optional
        How many times the range of the samples around a spike is outside of it.
    """
    hit = np.zeros(len(values), dtype=bool)
    h = SPIKE_NEIGHBOURS
    if len(values) <= 2 * h or noise <= 0.0:
        return hit
    # whatever is outside the range of all around is as far from the mean of the nearest two
    off = np.abs(values[1:-1] - (values[:-2] + values[2:]) / 2.0)
    where = np.flatnonzero(off > SPIKE_NOISE * noise) + 1
    where = where[(where >= h) & (where < len(values) - h)]
    middle, around = neighbourhood(values, where)
    low, high = around.min(axis=0), around.max(axis=0)
    over = np.maximum(middle - high, low - middle)
    # a quiet neighbourhood has a range of its noise: 3.3 sigma for twelve samples
    hit[where[(over > ranges * (high - low)) & (over > SPIKE_NOISE * noise)]] = True
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
    rate = 1.0 / float(np.median(np.diff(time_s)))
    if n < 256 or part.noise <= 0.0 or (time_s[-1] - time_s[0]) * rate > 2.0 * n:
        return None  # too few samples, or mostly gaps
    grid = time_s[0] + np.arange(int((time_s[-1] - time_s[0]) * rate)) / rate
    values = np.interp(grid, time_s, part.values)
    window = np.hanning(len(values))
    spectrum = 2.0 * np.abs(np.fft.rfft((values - values.mean()) * window)) / window.sum()
    width = rate / len(values)
    frequency = width * np.arange(len(spectrum))
    found = []
    for mains in MAINS_HZ:
        alias = abs(mains - rate * round(mains / rate))
        is_near = np.abs(frequency - alias) < MAINS_WIDTH_HZ
        is_beside = (np.abs(frequency - alias) < 10.0 * MAINS_WIDTH_HZ) & ~is_near
        if alias < 2.0 * MAINS_WIDTH_HZ or not is_near.any() or not is_beside.any():
            continue  # an alias this low is hidden in the motion
        peak = int(np.argmax(np.where(is_near, spectrum, 0.0)))
        shift, amplitude = _between_bins(spectrum, peak)
        if amplitude > max(HUM_NOISE * part.noise, HUM_LINE * float(spectrum[is_beside].max())):
            found.append((width * (peak + shift), amplitude, mains))
    return max(found, key=lambda tone: tone[1], default=None)


def _between_bins(spectrum: Floats, peak: int) -> tuple[float, float]:
    """Return a tone's place in bins from ``peak`` and its amplitude, of a Hann spectrum.

    Two bins of a tone d bins off have the ratio a = (1 + d) / (2 - d), and the larger is
    sin(pi d) / (pi d (1 - d^2)) of the amplitude (Grandke 1983, eqs. 8 and 10).
    """
    if not 0 < peak < len(spectrum) - 1:
        return 0.0, float(spectrum[peak])
    side = 1 if spectrum[peak + 1] > spectrum[peak - 1] else -1
    ratio = float(spectrum[peak + side] / spectrum[peak])
    d = min(max((2.0 * ratio - 1.0) / (ratio + 1.0), 0.0), 0.5)
    loss = np.sinc(d) / (1.0 - d**2)
    return side * d, float(spectrum[peak] / loss)


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
