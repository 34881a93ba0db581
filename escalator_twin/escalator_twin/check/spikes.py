"""Electrical outliers: one channel alone at one sample, told from a machine's impacts.

An impact moves the other axes of the same message at the same sample, or rings in the samples
after; an electrical outlier leaves both as they were.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.stats import poisson

from escalator_twin.check.parts import Part, parts_of
from escalator_twin.check.values import neighbourhood, spike_mask
from escalator_twin.machine import Sensor
from escalator_twin.signals import Finding, Floats, Nanoseconds, Signal

SIDE = 6  # samples on either side whose unrest is compared
# Another axis is untouched where it departs from the mean of its neighbours by less than this, in
# standard deviations of its noise: of outliers put in, one in twenty meets an impact's ringing.
STRICT_OTHER = 6.0
LOOSE_OTHER = 8.0
# The samples after are at rest where their second differences have less than this many times the
# variance of noise, or of those before. Impacts that were taken for outliers have 5 to 1000.
REST = 3.0
STRICT_RING = 3.0
LOOSE_RING = 15.0
# What is far out of the range around by less than this counts only where outliers are proven.
LOOSE_RANGE = 0.7
LOOSE_SHARE = 0.2  # of its size that may be an impact's elsewhere
LOOSE_SIZE = 0.6  # ... and is not much smaller than these, by their median
# Of 36 recordings of machines without this fault (4025 s of three axes each), seven hits pass all
# tests; those that recur in like distances are one. So five in 12 000 s, 4e-4 per second; machines
# differ, so twelve times that is allowed for. The count that this gives with a chance of 1e-3 is
# what a clean machine may have, and never is fewer than five a fault (one of the 108 had three).
CLEAN_PER_S = 0.005
CLEAN_CHANCE = 1e-3
LEAST = 5
# No impact moves one gauge of four: there, two are enough. One alone is not told.
LEAST_LONE = 2
SAME_DISTANCE = 0.02


class Hits(NamedTuple):
    """Samples of one channel that stand out.

    Attributes
    ----------
    stamp_ns : (n,) int64
    size : (n,) float64
        Distance from the samples around, in the channel's unit.
    is_strict : (n,) bool
        Passes all tests; the rest counts only beside such.
    is_lone : (n,) bool
        In some of the channel's parts and not in others.
    """

    stamp_ns: Nanoseconds
    size: Floats
    is_strict: NDArray[np.bool_]
    is_lone: NDArray[np.bool_]

    def cut(self, from_ns: int, to_ns: int) -> 'Hits':
        """Return those with stamps in [from_ns, to_ns)."""
        kept = (self.stamp_ns >= from_ns) & (self.stamp_ns < to_ns)
        return Hits(self.stamp_ns[kept], self.size[kept], self.is_strict[kept], self.is_lone[kept])


def join_hits(parts: Sequence[Hits]) -> Hits:
    """Return the hits of successive parts of a channel."""
    stamp_ns, size, is_strict, is_lone = zip(*parts, strict=True)
    return Hits(
        np.concatenate(stamp_ns),
        np.concatenate(size),
        np.concatenate(is_strict),
        np.concatenate(is_lone),
    )


def find_hits(signal: Signal, sensor: Sensor, others: list[tuple[Signal, Sensor]]) -> Hits:
    """Find what stands out of a channel and leaves the ``others`` of its topic untouched."""
    parts = parts_of(signal, sensor)
    n = len(signal.values)
    loose, sharp = np.zeros((2, len(parts), n), dtype=bool)
    for k, part in enumerate(parts):
        loose[k] = spike_mask(part.values, _noise(part), LOOSE_RANGE)
        sharp[k] = spike_mask(part.values, _noise(part))
    where = np.flatnonzero(loose.any(axis=0))
    is_lone: NDArray[np.bool_] = np.asarray(~loose[:, where].all(axis=0))
    other, before, after = _unrest(signal, parts, where, others)

    is_quiet = (other < STRICT_OTHER) & (after < np.maximum(REST, STRICT_RING * before))
    is_strict = sharp[:, where].any(axis=0) & (is_quiet | is_lone)
    size = np.abs(neighbourhood(signal.values, where)[0]) if len(where) else np.zeros(0)
    # what is small against the outliers that are proven hides none of them
    proven = float(np.median(size[is_strict])) if is_strict.any() else 0.0
    height = np.minimum(size, proven) / max(
        max(_noise(part) for part in parts), np.finfo(float).tiny
    )
    is_calm = other < np.maximum(LOOSE_OTHER, LOOSE_SHARE * height)
    rest = np.maximum(np.maximum(REST, LOOSE_RING * before), (LOOSE_SHARE / 2.0 * height) ** 2)
    kept: NDArray[np.bool_] = np.asarray(is_strict | is_lone | (is_calm & (after < rest)))
    return Hits(signal.stamp_ns[where][kept], size[kept], is_strict[kept], is_lone[kept])


def _noise(part: Part) -> float:
    """Return one standard deviation of a part's noise, at least that of its rounding."""
    return max(part.noise, part.resolution / float(np.sqrt(12.0)))


def _unrest(
    signal: Signal,
    parts: list[Part],
    where: NDArray[np.int64],
    others: list[tuple[Signal, Sensor]],
) -> tuple[Floats, Floats, Floats]:
    """Return how far the other axes are off at each sample, and the unrest before and after.

    All in the noise of each: a distance in standard deviations, variances of second differences.
    """
    off = np.zeros(len(where))
    rest = [_sides(part, where) for part in parts]
    for signal_, sensor in others:
        same = np.searchsorted(signal_.stamp_ns, signal.stamp_ns[where])
        same = np.clip(same, 0, len(signal_.stamp_ns) - 1)
        same_stamp = signal_.stamp_ns[same] == signal.stamp_ns[where]
        is_inner = (same >= SIDE) & (same < len(signal_.stamp_ns) - SIDE)
        there: NDArray[np.bool_] = np.asarray(same_stamp & is_inner)
        for part in parts_of(signal_, sensor):
            v, at = part.values, same[there]
            if _noise(part) <= 0.0:
                continue
            # the mean of two neighbours adds half a variance
            step = np.abs(v[at] - (v[at - 1] + v[at + 1]) / 2.0) / (_noise(part) * np.sqrt(1.5))
            off[there] = np.maximum(off[there], step)
            sides = np.full((2, len(where)), np.nan)
            sides[:, there] = _sides(part, at)
            rest.append(sides)
    with np.errstate(all='ignore'):
        before, after = np.nan_to_num(np.nanmean(np.array(rest), axis=0))
    return off, before, after


def _sides(part: Part, where: NDArray[np.int64]) -> Floats:
    """Return the mean square of second differences before and after, 1 for white noise."""
    noise = _noise(part)
    if noise <= 0.0 or not len(where):
        return np.zeros((2, len(where)))
    windows = [part.values[where + np.arange(1, SIDE + 1)[:, None] * sign] for sign in (-1, 1)]
    return np.array(
        [(np.diff(w, 2, axis=0) ** 2).mean(axis=0) / (6.0 * noise**2) for w in windows]
    )


def outliers(
    signal: Signal, sensor: Sensor, others: list[tuple[Signal, Sensor]]
) -> NDArray[np.bool_]:
    """Tell of each sample of each part whether it is an outlier, (parts, n): all false if clean."""
    hits = find_hits(signal, sensor, others)
    stamps = hits.stamp_ns[told(hits, float(np.ptp(signal.stamp_ns)) / 1e9)]
    here: NDArray[np.bool_] = np.isin(signal.stamp_ns, stamps)
    parts = parts_of(signal, sensor)
    return np.array([here & spike_mask(p.values, _noise(p), LOOSE_RANGE) for p in parts])


def told(hits: Hits, duration_s: float) -> NDArray[np.bool_]:
    """Tell which hits are outliers: none where a clean machine gives as many."""
    strict = hits.stamp_ns[hits.is_strict & ~hits.is_lone]
    least = max(LEAST, 1 + int(poisson.isf(CLEAN_CHANCE, CLEAN_PER_S * duration_s)))
    is_common = independent(strict) >= least
    if not is_common and int((hits.is_strict & hits.is_lone).sum()) < LEAST_LONE:
        return np.zeros(len(hits.size), dtype=bool)
    size = float(np.median(hits.size[hits.is_strict]))
    found: NDArray[np.bool_] = hits.is_strict | (hits.size > LOOSE_SIZE * size)
    return found if is_common else found & hits.is_lone


def judge_hits(hits: Hits, signal: Signal, duration_s: float, start_ns: int) -> list[Finding]:
    """Return the finding where there are more hits than a clean machine gives."""
    which = told(hits, duration_s)
    if not which.any():
        return []
    where = (hits.stamp_ns[which] - start_ns) / 1e9
    text = f'{len(where)} isolated outliers, the largest of {hits.size[which].max():.3g} {signal.unit}'
    return [Finding('sensor_spikes', signal.channel, float(where[0]), float(where[-1]), text)]


def independent(stamps: Nanoseconds) -> int:
    """Return how many hits there are, those that recur in like distances counted as one."""
    distance = np.diff(stamps).astype(np.float64)
    recurs = np.abs(np.diff(distance)) < SAME_DISTANCE * distance[1:]
    return len(stamps) - int(recurs.sum())
