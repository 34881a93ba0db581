"""Repair the ROS wheels of a virtual environment so that CMake accepts them.

The wheels were built elsewhere: their exported CMake targets name the include directories of the
build machine's Python and numpy, and CMake refuses targets whose directories do not exist. This
script puts this environment's directories there. Running it again changes nothing.

Usage: path/to/venv/bin/python fix_ros_wheels.py
"""

from pathlib import Path
import re
import sys
import sysconfig

import numpy as np

EXPORTS = 'share/*/cmake/*__rosidl_generator_pyExport.cmake'
PYTHON_INCLUDE = re.compile(r'/opt/python/cp\d+-cp\d+/include/python3\.\d+')
NUMPY_INCLUDE = re.compile(
    r'/opt/python/cp\d+-cp\d+/lib/python3\.\d+/site-packages/numpy/_core/include'
)


def repair(text: str, python_include: str, numpy_include: str) -> str:
    """Return ``text`` with the foreign include directories replaced."""
    text = NUMPY_INCLUDE.sub(lambda _: numpy_include, text)
    return PYTHON_INCLUDE.sub(lambda _: python_include, text)


def main() -> int:
    """Repair the environment that runs this script."""
    python_include = sysconfig.get_path('include')
    n_repaired = 0
    for path in sorted(Path(sys.prefix).glob(EXPORTS)):
        before = path.read_text(encoding='utf-8')
        after = repair(before, python_include, np.get_include())
        if after != before:
            path.unlink()  # the file may be a hard link into the installer's cache
            path.write_text(after, encoding='utf-8')
            n_repaired += 1
    if n_repaired:
        print(f'setup: repaired the include directories of {n_repaired} ROS wheels')
    return 0


if __name__ == '__main__':
    sys.exit(main())
