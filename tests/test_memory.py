"""Memory of large arrays is kept for the next ones: counted by the system, in processes of their own."""

from pathlib import Path
import subprocess
import sys

import pytest

from escalator_twin import memory, pipeline

pytestmark = pytest.mark.issue(7)

PAGE = 4096
ARRAYS, BYTES = 40, 24 << 20
CHILD = f"""
import resource
import numpy as np
from escalator_twin.memory import keep_freed
print(int(keep_freed()))
def work():
    for _ in range({ARRAYS}):
        np.ones({BYTES}, np.uint8)
work()
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
work()
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


def test_arrays_take_the_pages_of_those_before():
    done = subprocess.run(
        [sys.executable, '-c', CHILD], capture_output=True, text=True, check=True
    )
    is_kept, faults = map(int, done.stdout.split())
    if not is_kept:
        pytest.skip('memory is kept with glibc alone, and this is another C library')
    assert faults < 0.05 * ARRAYS * BYTES / PAGE


def test_on_another_library_nothing_is_changed(monkeypatch):
    class Other:
        """A C library without what is glibc's."""

    monkeypatch.setattr(memory.ctypes, 'CDLL', lambda _: Other())
    assert memory.keep_freed.__wrapped__() is False


def test_a_diagnosis_keeps_it_before_anything_is_read(monkeypatch):
    class KeptError(Exception):
        pass

    def keep():
        raise KeptError

    monkeypatch.setattr(pipeline, 'keep_freed', keep)
    with pytest.raises(KeptError):
        pipeline.diagnose([], Path('nowhere.yaml'))
