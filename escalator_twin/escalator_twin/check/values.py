"""Faults of sensors that show in their own signal: clipped, spiky, humming."""

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from escalator_twin.check.parts import finding_of, in_field, is_coarse, Part, parts_of
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
# Samples piled up at an extreme against the fullest of the next bins.
CLIP_COUNT = 20
CLIP_RATIO = 4.0
CLIP_BINS = 5


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
            value = in_field(sign * float((sign * part.values).max()), sensor)
            text = f'{which}{len(hit)} samples at the {name} value, {value:.5g}'
            findings.append(
                finding_of('saturation', signal, time_s, int(hit[0]), int(hit[-1]), text)
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
        f'a tone of {in_field(amplitude, sensor):.3g} (amplitude of a field) at {frequency:.2f} Hz: '
        f'mains of {mains:g} Hz'
    )
    return [finding_of('mains_hum', signal, time_s, 0, len(time_s) - 1, text)]


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
    if not found:
        return None
    near, _, mains = max(found, key=lambda tone: tone[1])
    return (*_at_samples(part.values, time_s, near, width), mains)


def _at_samples(
    values: Floats, time_s: Floats, near_hz: float, width_hz: float
) -> tuple[float, float]:
    """Return frequency and amplitude of a tone by the samples themselves, to a bin's width to either side.

    Between samples a straight line takes off a part of it: where the even grid drifts past them, 12 % of 60 Hz at 200 Hz.
    """
    part = (time_s - time_s[0]) / (time_s[-1] - time_s[0])
    window = np.sin(np.pi * part) ** 2
    weighed = (values - values.mean()) * window

    def amplitude(frequency_hz: float) -> float:
        turn = np.exp(-2j * np.pi * frequency_hz * time_s)
        return float(2.0 * np.abs(weighed @ turn) / window.sum())

    best = optimize.minimize_scalar(
        lambda f: -amplitude(f), bounds=(near_hz - width_hz, near_hz + width_hz), method='bounded'
    )
    return float(best.x), amplitude(float(best.x))


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
