"""Files that the nodes read and write."""

from collections.abc import Mapping
import json
import math
import os
from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_share_directory, PackageNotFoundError
import numpy as np

from escalator_twin.errors import EscalatorError
from escalator_twin.machine import load_machine, Machine

PACKAGE = 'escalator_twin'


def find_machine(text: str) -> Machine:
    """Load a machine's description: the file as given, or else below this package's share.

    Raises
    ------
    MachineError
        Where it cannot be read or is wrong.
    """
    path = Path(text)
    if not path.is_file() and not path.is_absolute():
        try:
            installed = Path(get_package_share_directory(PACKAGE)) / path
        except (PackageNotFoundError, LookupError):
            installed = path
        path = installed if installed.is_file() else path
    return load_machine(path)


def check_writable(path: str) -> None:
    """Raise an EscalatorError where a document could not be written later; '' is no document."""
    folder = Path(path).absolute().parent
    if path and (Path(path).is_dir() or not os.access(folder, os.W_OK)):
        raise EscalatorError(f'json: {path}: cannot be written')


def write_json(path: str, document: Mapping[str, Any]) -> None:
    """Write a document; what is no finite number becomes null.

    Raises
    ------
    EscalatorError
        Where the file cannot be written.
    """
    text = json.dumps(_plain(document), indent=2, ensure_ascii=False, allow_nan=False)
    try:
        Path(path).write_text(text + '\n', encoding='utf-8')
    except OSError as error:
        raise EscalatorError(f'{path}: cannot be written: {error.strerror or error}') from error


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
