"""A progress line on a terminal; nothing anywhere else."""

from collections.abc import Callable
import sys
import time
from typing import TextIO

# called with what is done and what there is to do, in the same unit
Progress = Callable[[float, float], None]

WIDTH = 30
INTERVAL_S = 0.1  # between two drawings


class ProgressLine:
    """Draw ``[####----]  50 %`` over itself; a context manager that leaves a clean line."""

    def __init__(self, stream: TextIO | None = None, clock: Callable[[], float] = time.monotonic):
        self._stream = stream or sys.stderr
        self._clock = clock
        self._is_on = self._stream.isatty()
        self._last = -INTERVAL_S

    def __call__(self, done: float, total: float = 1.0) -> None:
        """Show that ``done`` of ``total`` is reached."""
        share = min(max(done / total, 0.0), 1.0) if total > 0.0 else 1.0
        now = self._clock()
        if not self._is_on or (now - self._last < INTERVAL_S and share < 1.0):
            return
        self._last = now
        bar = '#' * round(share * WIDTH)
        self._stream.write(f'\r\x1b[K[{bar:-<{WIDTH}}] {100 * share:3.0f} %')
        self._stream.flush()

    def __enter__(self) -> 'ProgressLine':
        """Return the line."""
        return self

    def __exit__(self, *_: object) -> None:
        """Wipe the line."""
        if self._is_on and self._last >= 0.0:
            self._stream.write('\r\x1b[K')
            self._stream.flush()
