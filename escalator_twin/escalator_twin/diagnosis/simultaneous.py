"""Simulations on threads: the compiled loop runs without the lock of Python."""

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

Ran = TypeVar('Ran')  # what a simulation is for
Progress = Callable[[float, float], None]


def run_all(
    tasks: Mapping[object, Callable[[], Ran]], jobs: int, progress: Progress | None
) -> dict[object, Ran]:
    """Run tasks, ``jobs`` at a time; ``progress`` gets (done, total)."""
    done = 0
    found: dict[object, Ran] = {}
    with ThreadPoolExecutor(max(1, jobs)) as pool:
        futures = {key: pool.submit(task) for key, task in tasks.items()}
        for key, future in futures.items():
            found[key] = future.result()
            done += 1
            if progress is not None:
                progress(done, len(tasks))
    return found
