"""Build serialised messages (CDR, little endian) from values at field paths."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from rosbags.interfaces import Nodetype

from escalator_twin.bagfile.cdr import CdrError, fields_of, NUMBERS
from escalator_twin.bagfile.definitions import Types
from escalator_twin.conversions import Path, path_text


def encode(name: str, types: Types, values: Mapping[Path, float | int | str]) -> bytes:
    """Build a message: ``values`` at their paths, zero, '' and empty elsewhere (little endian).

    Raises
    ------
    CdrError
        Where a path is not of the type.
    """
    out = bytearray(b'\x00\x01\x00\x00')
    left = dict(values)
    _encode_message(out, name, types, (), left)
    if left:
        path = next(iter(left))
        raise CdrError(f'{name} has no field {path_text(path)!r}')
    return bytes(out)


def _encode_message(
    out: bytearray, name: str, types: Types, path: Path, left: dict[Path, float | int | str]
) -> None:
    for field, (kind, detail) in fields_of(name, types):
        _encode_value(out, kind, detail, types, (*path, field), left)


def _encode_value(
    out: bytearray,
    kind: Any,
    detail: Any,
    types: Types,
    path: Path,
    left: dict[Path, float | int | str],
) -> None:
    if kind == Nodetype.NAME:
        _encode_message(out, detail, types, path, left)
    elif kind == Nodetype.BASE:
        _encode_base(out, detail[0], left.pop(path, None))
    else:
        element, n = detail
        if kind == Nodetype.SEQUENCE:
            depth = len(path)
            n = 1 + max(
                (int(p[depth]) for p in left if len(p) > depth and p[:depth] == path), default=-1
            )
            _encode_base(out, 'uint32', n)
        for i in range(n):
            _encode_value(out, element[0], element[1], types, (*path, i), left)


def _encode_base(out: bytearray, name: str, value: float | int | str | None) -> None:
    if name == 'string':
        text = str(value or '').encode() + b'\x00'
        _encode_base(out, 'uint32', len(text))
        out += text
        return
    if name not in NUMBERS:
        raise CdrError(f'fields of type {name} are not written')
    dtype = np.dtype(NUMBERS[name]).newbyteorder('<')
    out += b'\x00' * (-(len(out) - 4) % dtype.itemsize)
    try:
        out += np.array(value or 0, dtype=dtype).tobytes()
    except (ValueError, OverflowError, TypeError) as error:
        raise CdrError(f'{value!r} is no {name}') from error
