"""The extended machine: accepted causes as a description that the simulator runs as it stands."""

from collections.abc import Mapping, Sequence
import hashlib
import os
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from escalator_twin import __version__
from escalator_twin.machine import Machine

HASHED_BYTES = 1 << 20


def fingerprint(path: str) -> str:
    """Return the SHA-256 of a recording's files: their names, sizes and bytes."""
    digest = hashlib.sha256()
    root = Path(path)
    for file in sorted(root.iterdir()) if root.is_dir() else [root]:
        if not file.is_file():
            continue
        digest.update(file.name.encode())
        with file.open('rb') as stream:
            while block := stream.read(HASHED_BYTES):
                digest.update(block)
    return digest.hexdigest()


def extension(
    machine: Machine,
    folder: Path,
    recordings: Sequence[str],
    effects: Sequence[Mapping[str, Any]],
    accepted: Sequence[Mapping[str, Any]],
    seed: int,
) -> dict[str, Any]:
    """Return an extended machine's description.

    Parameters
    ----------
    machine : Machine
        That is extended.
    folder : Path
        Where the description will be.
    recordings : sequence of str
        Paths.
    effects : sequence of mapping
        All accepted effects as the JSON tells them: provenance.
    accepted : sequence of mapping
        Deviations of the machine: cause, location, parameters as numbers.
    seed : int
    """
    assert machine.source is not None
    return {
        'extends': os.path.relpath(machine.source.resolve(), folder.resolve()),
        'deviations': [dict(deviation) for deviation in accepted],
        'provenance': {
            'tool': f'escalator_twin {__version__}',
            'seed': seed,
            'extends_sha256': fingerprint(str(machine.source)),
            'recordings': [{'path': path, 'sha256': fingerprint(path)} for path in recordings],
            'effects': [dict(effect) for effect in effects],
        },
    }


def plain(value: Any) -> Any:
    """Return a value with Python's own numbers, lists and dictionaries alone."""
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Mapping):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return value


def write_extension(path: Path, description: Mapping[str, Any]) -> None:
    """Write an extended machine's description."""
    path.parent.mkdir(parents=True, exist_ok=True)
    text = yaml.safe_dump(plain(description), sort_keys=False, allow_unicode=True, width=100)
    path.write_text(text, encoding='utf-8')
