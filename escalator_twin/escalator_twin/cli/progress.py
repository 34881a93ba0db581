"""A progress line on a terminal; nothing anywhere else."""

from collections.abc import Callable
import sys
import time
from typing import TextIO

# called with the share that is done, 0 to 1, and what is being done
Progress = Callable[[float, str], None]

WIDTH = 30
INTERVAL_S = 0.1  # between two drawings


class ProgressLine:
    """Draw ``[####----]  50 % text`` over itself; a context manager that leaves a clean line."""

    def __init__(self, stream: TextIO | None = None, clock: Callable[[], float] = time.monotonic):
        self._stream = stream or sys.stderr
        self._clock = clock
        self._is_on = self._stream.isatty()
        self._last = -INTERVAL_S

    def __call__(self, done: float, text: str = '') -> None:
        """Show that the share ``done`` (0 to 1) is reached."""
        now = self._clock()
        if not self._is_on or (now - self._last < INTERVAL_S and done < 1.0):
            return
        self._last = now
        done = min(max(done, 0.0), 1.0)
        bar = '#' * round(done * WIDTH)
        self._stream.write(f'\r\x1b[K[{bar:-<{WIDTH}}] {100 * done:3.0f} % {text}'.rstrip())
        self._stream.flush()

    def __enter__(self) -> 'ProgressLine':
        """Return the line."""
        return self

    def __exit__(self, *_: object) -> None:
        """Wipe the line."""
        if self._is_on and self._last >= 0.0:
            self._stream.write('\r\x1b[K')
            self._stream.flush()
