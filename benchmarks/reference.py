"""A fixed piece of work timed beside each benchmark, so that machines can be compared."""

import time

import numpy as np

N, PASSES = 200_000, 40


def reference_s() -> float:
    """Return the seconds that a fixed vectorised loop takes on one core now."""
    values = np.linspace(0.0, 1.0, N)
    start = time.perf_counter()
    for _ in range(PASSES):
        values = np.sqrt(values * values + 1e-3)
    return time.perf_counter() - start
