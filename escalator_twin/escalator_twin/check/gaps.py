"""Faults of sampling: rate, jitter, gaps, values that stand still."""

import numpy as np

from escalator_twin.machine import Sensor
from escalator_twin.signals import Finding, Floats, Signal

# A rate off by more than this is another setting of the logger: its clock is off by 1e-4 at most.
RATE_SHARE = 0.01
# Share of the period by which one stamp in a hundred may be off. A quarter of 5 ms shifts a
# sample at 2 Hz by 1.6 % of the amplitude: what correlations of 0.999 still allow.
JITTER_SHARE = 0.25
# From this many missing samples in a row a gap is told by itself: 50 ms of 200 Hz is a whole
# period at the upper edge of what is compared, 20 Hz; shorter ones are interpolated safely.
LONG_GAP = 10
MAX_TOLD = 10
# Chance of calling a live signal still, for a whole recording.
STILL_CHANCE = 1e-6


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
    time = (signal.stamp_ns - start_ns) / 1e9
    steps = np.diff(time)
    period = float(np.median(steps))
    findings = []

    def tell(kind: str, from_s: float, to_s: float, text: str) -> None:
        findings.append(Finding(kind, signal.channel, float(from_s), float(to_s), text))

    rate = 1.0 / period
    if abs(rate / sensor.rate_hz - 1.0) > RATE_SHARE:
        text = f'{rate:.2f} Hz, expected {sensor.rate_hz:g} Hz'
        tell('rate', time[0], time[-1], text)
    regular = steps[steps < 1.5 * period]
    jitter = float(np.quantile(np.abs(regular / period - 1.0), 0.99))
    if jitter > JITTER_SHARE:
        text = f'stamps off by up to {100 * jitter:.0f} % of the period (99 % of them)'
        tell('jitter', time[0], time[-1], text)
    missing = np.rint(steps / period).astype(int) - 1
    long = np.flatnonzero(missing >= LONG_GAP)
    for i in long[np.argsort(-missing[long], kind='stable')][:MAX_TOLD]:
        tell('data_gap', time[i], time[i + 1], f'{missing[i]} samples missing')
    if len(long) > MAX_TOLD:
        tell('data_gap', time[0], time[-1], f'{len(long) - MAX_TOLD} more gaps of this kind')
    short = (missing > 0) & (missing < LONG_GAP)
    if short.any():
        text = f'{missing[short].sum()} samples missing in {short.sum()} short gaps'
        tell('data_gap', time[:-1][short][0], time[1:][short][-1], text)
    return findings


def edges(signals: list[tuple[Signal, Sensor]], start_ns: int, end_ns: int) -> list[Finding]:
    """Tell which channels of one logger begin late or end early.

    Parameters
    ----------
    signals : list of (Signal, Sensor)
        All of one logger.
    start_ns, end_ns : int
        First and last stamp of the logger.
    """
    findings = []
    for signal, sensor in signals:
        period = 1e9 / sensor.rate_hz
        for first, last in ((start_ns, signal.stamp_ns[0]), (signal.stamp_ns[-1], end_ns)):
            n_missing = round(float(last - first) / period)
            if n_missing >= LONG_GAP:
                from_s, to_s = ((int(t) - start_ns) / 1e9 for t in (first, last))
                text = f'{n_missing} samples missing at an end that other channels have'
                findings.append(Finding('data_gap', signal.channel, from_s, to_s, text))
    return findings


def longest_live_run(noise: float, resolution: float, n: int) -> int:
    """Return how many equal values in a row a live, noisy signal may give.

    Two rounded samples of noise sigma agree with at most p = q / (sigma sqrt(2 pi)), the middle
    bin's share; n p^(k - 1) is the expected number of runs of k.
    """
    p = min(max(resolution / (noise * np.sqrt(2.0 * np.pi)), 0.02), 0.8)
    return 2 + int(np.ceil(np.log(STILL_CHANCE / max(n, 1)) / np.log(p)))


def still_runs(values: Floats, longest: int) -> list[tuple[int, int]]:
    """Return begin and end (inclusive) of runs of more than ``longest`` equal values."""
    is_same = np.concatenate([[False], np.diff(values) == 0.0, [False]])
    change = np.diff(is_same.astype(np.int8))
    begins, ends = np.flatnonzero(change == 1), np.flatnonzero(change == -1)
    return [(int(b), int(e)) for b, e in zip(begins, ends, strict=True) if e - b + 1 > longest]
