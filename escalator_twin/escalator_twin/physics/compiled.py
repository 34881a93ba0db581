"""How the law's functions are compiled, and where the result is kept.

Compiled code is kept in a folder named after the text of the whole package: a function that holds
another one's code must not outlive it, and numba looks at a function's own file only.
"""

from collections.abc import Callable
from functools import cache
import hashlib
import os
from pathlib import Path
import tempfile
from typing import Any, Literal

from numba import njit
from numba.core import config


@cache
def cache_folder() -> str:
    """Return a folder for compiled code: beside the source, else in the user's cache, else /tmp."""
    sources = sorted(Path(__file__).parent.rglob('*.py'))
    text = hashlib.sha256(b'\0'.join(path.read_bytes() for path in sources)).hexdigest()[:16]
    home = Path(os.environ.get('XDG_CACHE_HOME') or Path.home() / '.cache')
    choices = [
        Path(__file__).parent / '__pycache__',
        home / 'escalator_twin',
        Path(tempfile.gettempdir()) / f'escalator_twin_{os.getuid()}',
    ]
    if os.environ.get('NUMBA_CACHE_DIR'):
        choices.insert(0, Path(os.environ['NUMBA_CACHE_DIR']))
    for choice in choices:
        folder = choice / f'compiled_{text}'
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(folder, os.W_OK):
            return str(folder)
    return tempfile.mkdtemp(prefix='escalator_twin_')


def _compile(
    function: Callable[..., Any], inline: Literal['never', 'always'], allocates: bool
) -> Any:
    """Compile with what all functions share: no interpreter lock, no branch at a division."""
    before = config.CACHE_DIR  # type: ignore[attr-defined]
    config.CACHE_DIR = cache_folder()  # type: ignore[attr-defined]
    # numba's name for counted references; its annotations leave it out
    counting: dict[str, Any] = {'_nrt': allocates}
    try:
        return njit(
            function, cache=True, nogil=True, error_model='numpy', inline=inline, **counting
        )
    finally:
        config.CACHE_DIR = before  # type: ignore[attr-defined]


def compiled(function: Callable[..., Any]) -> Any:
    """Compile a function when it is first called; it may not make arrays.

    Whoever calls it holds the arrays. Nothing is counted then: each NamedTuple handed to a
    function would cost an atomic addition for each of its arrays, a third of the planar step.
    """
    return _compile(function, 'never', allocates=False)


def inlined(function: Callable[..., Any]) -> Any:
    """Compile a function into each of its callers: a NamedTuple handed on costs nothing then."""
    return _compile(function, 'always', allocates=False)


def allocating(function: Callable[..., Any]) -> Any:
    """Compile a function that makes arrays."""
    return _compile(function, 'never', allocates=True)
