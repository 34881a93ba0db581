"""How the benchmarks measure: alone in a process, in turns, the best of several rounds.

Seconds are wall time unless they say processor. Where other programs keep the cores busy, wall
time says little and ``load`` tells it; ratios of processor time, taken in turns, then change least.
"""

from collections.abc import Callable, Sequence
from multiprocessing import get_context
import os
from pathlib import Path
import re
import time
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parents[1]
MACHINE = ROOT / 'config' / 'machines' / 'prototype.yaml'
MB = 1024.0  # of the kilobytes in which Linux gives resident memory
PEAK = re.compile(r'VmHWM:\s+(\d+) kB')

Result = dict[str, Any]


class Spent(NamedTuple):
    """Seconds that a piece of work took."""

    wall_s: float
    processor_s: float


def spent(work: Callable[[], object]) -> Spent:
    """Return what a piece of work takes now."""
    wall, processor = time.perf_counter(), time.process_time()
    work()
    return Spent(time.perf_counter() - wall, time.process_time() - processor)


def least(works: Sequence[Callable[[], object]], rounds: int) -> list[Spent]:
    """Return the least that each of several works takes, all in turns; the first round is not counted."""
    for work in works:
        work()
    rows = [[spent(work) for work in works] for _ in range(rounds)]
    columns = zip(*rows, strict=True)
    return [Spent(*(min(kind) for kind in zip(*column, strict=True))) for column in columns]


def load() -> float:
    """Return how many programs wanted a core during the last minute, this one among them."""
    return round(os.getloadavg()[0], 2)


def resident_mb() -> float:
    """Return the most memory that this process has had so far, MB.

    ``getrusage`` would count what the parent had when it started this process.
    """
    found = PEAK.search(Path('/proc/self/status').read_text(encoding='ascii'))
    assert found is not None
    return int(found[1]) / MB


def alone(work: Callable[..., Result], *arguments: object) -> Result:
    """Return what a benchmark finds in a process of its own."""
    with get_context('spawn').Pool(1) as pool:
        return pool.apply(work, arguments)
