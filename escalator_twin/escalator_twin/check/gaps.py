"""Faults of sampling: rate, jitter, gaps, values that stand still."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from escalator_twin.bagfile.reading import NO_NUMBERS
from escalator_twin.machine import Sensor
from escalator_twin.signals import Finding, Floats, Nanoseconds, Signal

# A rate off by more than this is another setting of the logger: its clock is off by 1e-4 at most.
RATE_SHARE = 0.01
# Share of the period by which one stamp in a hundred may be off. A quarter of 5 ms shifts a
# sample at 2 Hz by 1.6 % of the amplitude: what correlations of 0.999 still allow.
JITTER_SHARE = 0.25
# From this many missing samples in a row a gap is told by itself: 50 ms of 200 Hz is a whole
# period at the upper edge of what is compared, 20 Hz; shorter ones are interpolated safely.
LONG_GAP = 10
MAX_TOLD = 10
STILL = 'the value stands still'
SHORT, MORE = 'short gaps', 'more gaps of this kind'
# Chance of calling a live signal still, for a whole recording.
STILL_CHANCE = 1e-6
# Share of samples that repeat the one before, beyond what the description gives, from which a channel is taken to be
# coarser than described: twice what rounding a slow signal's noise adds to it.
MORE_REPEATS = 0.1
MOST_REPEATS = 0.99
BUNCHED = 3.0  # times as long: a signal that is coarse repeats where it is slow, not by chance


class Steps(NamedTuple):
    """What the distances between a channel's stamps say.

    Attributes
    ----------
    first_s, last_s : float
    n : int
        How many distances.
    period_s : float
        Their median.
    jitter : float
        Share of the period by which one in a hundred is off.
    long : (k, 3) float64
        Begin, end and number of missing samples of the gaps that are told one by one.
    short : (m, 3) float64
        Of the others.
    """

    first_s: float
    last_s: float
    n: int
    period_s: float
    jitter: float
    long: Floats
    short: Floats


def steps_of(stamp_ns: Nanoseconds, start_ns: int) -> Steps:
    """Return what two or more stamps in order say, in seconds from ``start_ns``."""
    time = (stamp_ns - start_ns) / 1e9
    steps = np.diff(time)
    period = float(np.median(steps))
    regular = steps[steps < 1.5 * period]
    jitter = float(np.quantile(np.abs(regular / period - 1.0), 0.99)) if len(regular) else 0.0
    missing = np.rint(steps / period) - 1.0
    gaps = np.column_stack([time[:-1], time[1:], missing])[missing > 0]
    is_long = gaps[:, 2] >= LONG_GAP
    return Steps(
        float(time[0]), float(time[-1]), len(steps), period, jitter, gaps[is_long], gaps[~is_long]
    )


def join_steps(parts: Sequence[Steps]) -> Steps:
    """Return what successive parts of a channel say together.

    Gaps add; the period is the median of the parts', the jitter their mean, both weighed by the
    number of distances.
    """
    n = np.array([part.n for part in parts])
    order = np.argsort([part.period_s for part in parts], kind='stable')
    middle = order[np.searchsorted(np.cumsum(n[order]), n.sum() / 2.0)]
    return Steps(
        parts[0].first_s,
        parts[-1].last_s,
        int(n.sum()),
        parts[middle].period_s,
        float(np.average([part.jitter for part in parts], weights=n)),
        np.concatenate([part.long for part in parts]),
        np.concatenate([part.short for part in parts]),
    )


def sampling(signal: Signal, sensor: Sensor, start_ns: int) -> list[Finding]:
    """Judge one channel's stamps against the rate that the machine says.

    Parameters
    ----------
    signal : Signal
        Ordered by stamp, each stamp once.
    sensor : Sensor
        Its description.
    start_ns : int
        Where 0 s is, on the channel's own clock.
    """
    if len(signal.stamp_ns) < 3:
        text = f'{len(signal.stamp_ns)} samples'
        return [Finding('data_gap', signal.channel, 0.0, 0.0, text)]
    return judge_steps(steps_of(signal.stamp_ns, start_ns), sensor)


def judge_steps(steps: Steps, sensor: Sensor) -> list[Finding]:
    """Return what is wrong with the distances of a channel's stamps."""
    findings = []

    def tell(kind: str, from_s: float, to_s: float, text: str) -> None:
        findings.append(Finding(kind, sensor.channel, float(from_s), float(to_s), text))

    first, last = steps.first_s, steps.last_s
    rate = 1.0 / steps.period_s
    if abs(rate / sensor.rate_hz - 1.0) > RATE_SHARE:
        tell('rate', first, last, f'{rate:.2f} Hz, expected {sensor.rate_hz:g} Hz')
    if steps.jitter > JITTER_SHARE:
        text = f'stamps off by up to {100 * steps.jitter:.0f} % of the period (99 % of them)'
        tell('jitter', first, last, text)
    order = np.argsort(-steps.long[:, 2], kind='stable')
    for from_s, to_s, missing in steps.long[order][:MAX_TOLD]:
        tell('data_gap', from_s, to_s, f'{int(missing)} samples missing')
    if len(steps.long) > MAX_TOLD:
        text = f'{len(steps.long) - MAX_TOLD} {MORE}'
        tell('data_gap', first, last, text)
    short = steps.short
    if len(short):
        text = f'{int(short[:, 2].sum())} samples missing in {len(short)} {SHORT}'
        tell('data_gap', short[0, 0], short[-1, 1], text)
    return findings


def edges(ends: Sequence[tuple[Sensor, int, int]], start_ns: int, end_ns: int) -> list[Finding]:
    """Tell which channels of one logger begin late or end early.

    Parameters
    ----------
    ends : sequence of (Sensor, int, int)
        First and last stamp of each channel of one logger.
    start_ns, end_ns : int
        First and last stamp of the logger.
    """
    findings = []
    for sensor, begin, end in ends:
        period = 1e9 / sensor.rate_hz
        for first, last in ((start_ns, begin), (end, end_ns)):
            n_missing = round(float(last - first) / period)
            if n_missing >= LONG_GAP:
                from_s, to_s = ((int(t) - start_ns) / 1e9 for t in (first, last))
                text = f'{n_missing} samples missing at an end that other channels have'
                findings.append(Finding('data_gap', sensor.channel, from_s, to_s, text))
    return findings


def is_scattered(finding: Finding) -> bool:
    """Tell whether a finding gathers what is lost here and there: from its begin to its end is no one gap."""
    return any(text in finding.detail for text in (SHORT, MORE, NO_NUMBERS))


def longest_live_run(noise: float, resolution: float, n: int, repeats: float = 0.0) -> int:
    """Return how many equal values in a row a live, noisy signal may give.

    Two rounded samples of noise sigma agree with at most p = q / (sigma sqrt(2 pi)), the middle
    bin's share; n p^(k - 1) is the expected number of runs of k.

    Parameters
    ----------
    noise, resolution : float
        As described, in the same unit.
    n : int
        Samples.
    repeats : float
        Share of the samples that repeat the one before. Where that is more than the description gives, the
        channel is coarser than described, or smoother: its own share counts, and it repeats in bunches.
    """
    p = min(max(resolution / (noise * np.sqrt(2.0 * np.pi)), 0.02), 0.8)
    bunch = 1.0
    if repeats > p + MORE_REPEATS:
        p, bunch = min(repeats, MOST_REPEATS), BUNCHED
    return 2 + int(np.ceil(bunch * np.log(STILL_CHANCE / max(n, 1)) / np.log(p)))


def share_of_repeats(values: Floats, longest: int) -> float:
    """Return which share of samples repeats the one before, runs of more than ``longest`` left out."""
    is_same = np.diff(values) == 0.0
    within = sum(end - begin for begin, end in still_runs(values, longest))
    rest = len(is_same) - within
    return float(np.sum(is_same) - within) / rest if rest > 0 else 0.0


def still_runs(values: Floats, longest: int) -> list[tuple[int, int]]:
    """Return begin and end (inclusive) of runs of more than ``longest`` equal values."""
    is_same = np.concatenate([[False], np.diff(values) == 0.0, [False]])
    change = np.diff(is_same.astype(np.int8))
    begins, ends = np.flatnonzero(change == 1), np.flatnonzero(change == -1)
    return [(int(b), int(e)) for b, e in zip(begins, ends, strict=True) if e - b + 1 > longest]
