"""What becomes of memory that large arrays leave behind."""

import ctypes
from functools import cache
import sys

# Of mallopt(3), glibc's malloc.h
M_TRIM_THRESHOLD, M_TOP_PAD, M_MMAP_MAX, M_ARENA_MAX = -1, -2, -4, -8
TRIM_BYTES = 1 << 30  # free at the heap's end before any is given back
PAD_BYTES = 64 << 20  # asked for at a time


@cache
def keep_freed() -> bool:
    """Let this process keep the memory of its arrays for the next ones, where its C library is glibc's.

    Else each array of some megabytes is given back to the system when it goes, and the next one is new pages,
    zeroed one by one: that took 7 % of the time of a campaign's diagnosis. The process is as large as it was at
    its largest until it ends; children that it forks keep memory as well.

    Returns
    -------
    is_kept : bool
        False on any other C library: all is as it was.
    """
    if not sys.platform.startswith('linux'):
        return False
    library = ctypes.CDLL(None)
    if not (hasattr(library, 'gnu_get_libc_version') and hasattr(library, 'mallopt')):
        return False
    # one arena: those of threads are small, and what does not fit in them is new pages again
    options = {
        M_ARENA_MAX: 1,
        M_MMAP_MAX: 0,
        M_TRIM_THRESHOLD: TRIM_BYTES,
        M_TOP_PAD: PAD_BYTES,
    }
    return all(library.mallopt(option, value) == 1 for option, value in options.items())
