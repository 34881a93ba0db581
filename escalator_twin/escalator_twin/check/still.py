"""Channels that stand still, and gauges that are dead or do not follow their twin."""

from collections.abc import Sequence
import itertools

import numpy as np
from numpy.typing import NDArray

from escalator_twin.check.gaps import longest_live_run, share_of_repeats, STILL, still_runs
from escalator_twin.check.parts import finding_of, in_field, is_coarse, own_noise, Part, parts_of
from escalator_twin.machine import Sensor
from escalator_twin.signals import Finding, Floats, Signal

# A live pair of gauges differs by its gain error and lateral bending, together below 20 %.
TWIN_SLOPE = (0.5, 2.0)
# A gauge that moves by less than this many times its noise where its twin moves is dead.
DEAD_NOISE = 3.0
HELD_S = 2.0  # a value that stands longer says nothing of how a live channel repeats
# A channel sticks where so many stands all end with a step as small as this quantile of live samples' steps: by chance
# one in twenty ends so (a link's noise is a twentieth of what it moves by), two in some hundreds.
LEAST_HELD = 2
USUAL_STEP = 0.95
MIN_LIVE = 1000  # samples of two gauges side by side that a judgement needs


def stillness(signal: Signal, sensor: Sensor, time_s: Floats) -> list[Finding]:
    """Find where a channel reads a constant, and gauges that read one or do not follow."""
    parts = parts_of(signal, sensor)
    is_still = _still_parts(parts, sensor)
    all_still: NDArray[np.bool_] = np.asarray(is_still.all(axis=0))
    findings = []
    spans = _spans(all_still)
    for begin, end in [] if _sticks(parts, all_still, spans) else spans:
        text = f'{STILL} for {time_s[end] - time_s[begin]:.2f} s'
        findings.append(finding_of('data_gap', signal, time_s, begin, end, text))
    if len(parts) > 1:
        for k, part in enumerate(parts):
            # where the whole channel stands still, one part may have read that value a sample before
            spans = _spans(is_still[k] & ~all_still)
            spans = [(a, b) for a, b in spans if b - a + 1 > _longest(part, sensor)]
            if spans:
                value = in_field(part.values[spans[0][0]], sensor)
                text = f'part {k + 1} of {len(parts)} reads a constant ({value:.4g})'
                begin, end = spans[0][0], spans[-1][1]
                findings.append(finding_of('gauge_dead', signal, time_s, begin, end, text))
        findings += _twins(signal, sensor, time_s, is_still)
    return findings


def _sticks(
    parts: Sequence[Part], is_still: NDArray[np.bool_], spans: Sequence[tuple[int, int]]
) -> bool:
    """Tell whether a channel goes on from where it stood, again and again: it sticks, and nothing is missing.

    A machine moves on while samples are missing: what comes after them is elsewhere, by more than one sample is from
    the next.
    """
    ended = [end for _, end in spans if end + 1 < len(is_still)]
    live = ~(is_still[1:] | is_still[:-1])
    if len(ended) < LEAST_HELD or live.sum() < MIN_LIVE:
        return False
    return all(_goes_on(part.values, ended, live) for part in parts)


def _goes_on(values: Floats, ended: Sequence[int], live: NDArray[np.bool_]) -> bool:
    steps = np.abs(np.diff(values))
    moving = steps[live & (steps > 0.0)]
    usual = np.quantile(moving, USUAL_STEP) if len(moving) else 0.0
    return bool((steps[list(ended)] <= usual).all())


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
            findings.append(finding_of('gauge_dead', signal, time_s, 0, end, text))
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


def _spans(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return begin and end (inclusive) of the runs of True."""
    change = np.diff(np.concatenate([[0], mask.astype(np.int8), [0]]))
    begins, ends = np.flatnonzero(change == 1), np.flatnonzero(change == -1) - 1
    return [(int(b), int(e)) for b, e in zip(begins, ends, strict=True)]
