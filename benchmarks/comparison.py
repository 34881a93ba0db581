"""What a comparison costs: all quick metrics on long channels, and one recording end to end.

Prints one JSON line each: ``python -m benchmarks.comparison``. A ratio is of processor time, to a
reference timed beside it in turns.
"""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
import json
import time

import numpy as np
from scipy import signal

from benchmarks.measure import alone, load, MACHINE, resident_mb, Result, ROOT
from escalator_twin import pipeline
from escalator_twin.machine import load_machine
from escalator_twin.metrics import machine_orders, score_channel, Track
from escalator_twin.metrics.registry import QUICK
from escalator_twin.signals import Floats

Pair = tuple[Floats, Floats]  # measured and simulated
Work = Callable[[Pair], None]

RECORDING = ROOT / 'bags' / 'sample_clean'
N_CHANNELS, N_SAMPLES, WORKERS = 20, 1_000_000, 2
RATE_HZ, SPEED_M_S = 200.0, 0.5
ROUNDS = 3  # of metrics and reference in turns; the fastest of each counts


def long_track() -> Track:
    """Return the prototype's track over all samples, its speed wandering by 0.2 %."""
    machine = load_machine(MACHINE)
    chain, n = machine.chain, N_SAMPLES
    t = np.arange(n) / RATE_HZ
    travel = SPEED_M_S * (t + 0.002 * 20.0 * np.sin(t / 20.0))
    orders = machine_orders(chain.n_links, chain.pitch_m, machine.roller.diameter_m)
    return Track(travel, RATE_HZ, chain.n_links * chain.pitch_m, chain.pitch_m, orders)


def channel(track: Track, index: int) -> Pair:
    """Return one channel, measured and simulated: loop, ripple and noise."""
    turn = 2.0 * np.pi * track.travel_m
    both = 1000.0 * np.cos(turn / track.loop_m + index)
    both += 30.0 * np.cos(turn / track.pitch_m)
    noise = np.random.default_rng(index).standard_normal(len(turn), np.float32)
    return both + noise, both


def measure(work: Work, make: Callable[[int], Pair]) -> tuple[float, float]:
    """Return the wall and processor seconds that ``work`` takes on all channels, two at a time.

    Channels are made beforehand, as many as are in work, and dropped after.
    """
    wall = processor = 0.0
    with ThreadPoolExecutor(WORKERS) as pool:
        for first in range(0, N_CHANNELS, WORKERS):
            batch = [make(i) for i in range(first, min(first + WORKERS, N_CHANNELS))]
            begin = time.perf_counter(), time.process_time()
            list(pool.map(work, batch))
            wall += time.perf_counter() - begin[0]
            processor += time.process_time() - begin[1]
    return wall, processor


def metrics() -> Result:
    """Time all quick metrics, in a process of its own for the sake of its memory."""
    track = long_track()
    sections = signal.butter(4, 2.0, fs=RATE_HZ, output='sos')

    def score(pair: Pair) -> None:
        score_channel(pair[0], pair[1], track, names=QUICK)

    def reference(pair: Pair) -> None:
        for row in pair:
            signal.sosfiltfilt(sections, row)

    def make(index: int) -> Pair:
        return channel(track, index)

    seconds, beside = [], []
    start, peak = resident_mb(), 0.0
    for _ in range(ROUNDS):
        seconds.append(measure(score, make))
        # before the reference, which takes more memory
        peak = peak or resident_mb()
        beside.append(measure(reference, make))
    spent, spent_beside = (min(p for _, p in rows) for rows in (seconds, beside))
    return {
        'benchmark': 'metrics',
        'channels': N_CHANNELS,
        'samples': N_SAMPLES,
        'metrics': len(QUICK),
        'workers': WORKERS,
        'seconds': min(seconds)[0],
        'processor_seconds': spent,
        'reference': 'scipy sosfiltfilt, Butterworth order 4 at 2 Hz, measured and simulated',
        'reference_seconds': min(beside)[0],
        'reference_processor_seconds': spent_beside,
        'ratio': spent / spent_beside,
        'peak_rss_mb': peak,
        'rss_before_mb': start,
        'bars': {'seconds': 3.0, 'peak_rss_mb': 500.0},
        'load': load(),
    }


def recording() -> Result:
    """Time the comparison of one recording, the first in a process and one more."""
    seconds = []
    for _ in range(2):
        begin = time.perf_counter()
        found = pipeline.compare_bag(str(RECORDING), MACHINE)
        seconds.append(time.perf_counter() - begin)
    overlay = next(iter(found['overlay']['channels'].values()))
    duration = overlay['time_s'][-1] - overlay['time_s'][0]
    return {
        'benchmark': 'compare_recording',
        'recording': str(RECORDING.relative_to(ROOT)),
        'recorded_s': duration,
        'first_seconds': seconds[0],
        'seconds': seconds[1],
        'times_real_time': duration / seconds[1],
        'load': load(),
    }


def results() -> Iterator[Result]:
    """Yield the result of each benchmark."""
    for work in (metrics, recording):
        yield alone(work)


def main() -> None:
    """Print the results, one line each."""
    for result in results():
        print(json.dumps(result), flush=True)


if __name__ == '__main__':
    main()
