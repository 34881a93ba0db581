"""JSON documents: written whole or not at all, and acceptance rules on their values."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
import json
import math
import operator
import os
from pathlib import Path
import re
from typing import Any

import numpy as np

from escalator_twin.errors import EscalatorError

Document = Mapping[str, Any]
OPERATORS = {'<=': operator.le, '>=': operator.ge}
_RULE = re.compile(r'\s*(\S.*?)\s*(<=|>=)\s*(\S+)\s*')


def plain(value: object) -> Any:
    """Return ``value`` as JSON can hold it: numpy's numbers made Python's, NaN and inf null."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Sequence) and not isinstance(value, str | bytes):
        return [plain(item) for item in value]
    if value is None or isinstance(value, bool | int | str):
        return value
    return str(value)


def dumps(document: Document) -> str:
    """Return a document as text."""
    return json.dumps(plain(document), indent=2, ensure_ascii=False, allow_nan=False) + '\n'


def check_writable(path: str) -> None:
    """Raise an EscalatorError where a document could not be written to ``path`` later."""
    target = Path(path)
    if path == '-' or (target.exists() and not target.is_file() and not target.is_dir()):
        return
    if target.is_dir():
        raise EscalatorError(f'--json {path}: is a directory')
    folder = target.absolute().parent
    if not folder.is_dir():
        raise EscalatorError(f'--json {path}: the directory {folder} is not there')
    if not os.access(target if target.exists() else folder, os.W_OK):
        raise EscalatorError(f'--json {path}: no permission to write')


def write_text(path: str, text: str) -> None:
    """Write a file whole or not at all."""
    target = Path(path)
    if target.exists() and not target.is_file():  # a pipe or a device
        target.write_text(text, encoding='utf-8')
        return
    part = target.with_name(f'.{target.name}.{os.getpid()}.part')
    try:
        part.write_text(text, encoding='utf-8')
        part.replace(target)
    except OSError as error:
        raise EscalatorError(f'{path}: cannot be written: {error.strerror or error}') from error
    finally:
        part.unlink(missing_ok=True)


@dataclass(frozen=True)
class Rule:
    """An acceptance rule: the values at ``name`` against ``limit``."""

    name: str
    relation: str
    limit: float

    @classmethod
    def parse(cls, text: str) -> 'Rule':
        """Read ``NAME<=VALUE`` or ``NAME>=VALUE``; raise ValueError where it is neither."""
        match = _RULE.fullmatch(text)
        if match is None:
            raise ValueError(f'expected NAME<=VALUE or NAME>=VALUE, found {text!r}')
        name, relation, limit = match.groups()
        try:
            value = float(limit)
        except ValueError:
            value = math.nan
        if math.isnan(value):
            raise ValueError(f'expected a number behind {relation}, found {text!r}')
        return cls(name, relation, value)

    def broken(self, document: Document) -> list[str]:
        """Return where ``document`` breaks the rule; a value of null breaks it.

        Raises
        ------
        EscalatorError
            Where the document has no such value, or it is no number.
        """
        texts = []
        for where, value in _values(plain(document), self.name.split('.'), ''):
            if not isinstance(value, int | float | None):
                kind = 'text' if isinstance(value, str) else 'no single value'
                raise EscalatorError(f'--require {self.name}: {where} is {kind}, not a number')
            if value is None or not OPERATORS[self.relation](value, self.limit):
                shown = 'null' if value is None else f'{value:g}'
                texts.append(f'{where} is {shown}, required {self.relation} {self.limit:g}')
        return texts


def _values(value: Any, names: list[str], where: str) -> list[tuple[str, Any]]:
    """Return all values at a dotted path; ``*`` stands for every key, a list for all its items."""
    if isinstance(value, list):
        return [
            found
            for i, item in enumerate(value)
            for found in _values(item, names, f'{where}[{i}]')
        ]
    if not names:
        return [(where, value)]
    name, *rest = names
    if isinstance(value, dict):
        keys = list(value) if name == '*' else [name] if name in value else []
        if keys or name == '*':
            return [
                found
                for key in keys
                for found in _values(value[key], rest, f'{where}.{key}'.lstrip('.'))
            ]
    raise EscalatorError(
        f'--require: unknown name {name!r} {f"in {where}" if where else "at the top"}; '
        f'expected {", ".join(value) if isinstance(value, dict) else "nothing below it"}'
    )
