"""Read serialised messages (CDR, little or big endian) by field path.

OMG DDS-XTypes 1.3, section 7.4.3 (XCDR version 1, final types): four bytes of encapsulation,
then the members in order, each aligned to its own size counted from behind the encapsulation;
strings and sequences after a length of four bytes. A message's layout depends on nothing but these
lengths: so one message is walked, and all that have the same lengths in the same places are
read by columns.
"""

from collections.abc import Sequence
import struct
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import Nodetype

from escalator_twin.bagfile.container import Bytes
from escalator_twin.bagfile.definitions import Types
from escalator_twin.conversions import Path, path_text

NUMBERS = {
    'bool': '?',
    'byte': 'u1',
    'char': 'u1',
    'octet': 'u1',
    'int8': 'i1',
    'uint8': 'u1',
    'int16': 'i2',
    'uint16': 'u2',
    'int32': 'i4',
    'uint32': 'u4',
    'int64': 'i8',
    'uint64': 'u8',
    'float32': 'f4',
    'float64': 'f8',
}
ORDERS: dict[bytes, Literal['<', '>']] = {b'\x00\x00': '>', b'\x00\x01': '<'}
MAX_DEPTH = 32
MAX_LAYOUTS = 256  # different layouts on one topic, beyond which each message is walked by itself


# what an empty message holds on the wire, as C knows no empty struct
EMPTY = (('structure_needs_at_least_one_member', (Nodetype.BASE, ('uint8', 0))),)


class CdrError(ValueError):
    """A message that does not fit its definition."""


class Place(NamedTuple):
    """Where a number stands in a message and what it is."""

    offset: int
    dtype: np.dtype[Any]


class Layout(NamedTuple):
    """What one message's walk found.

    ``guards`` are the offsets and values of the lengths met: a message with the same has the
    same places.
    """

    places: dict[Path, Place]
    texts: dict[Path, str]
    guards: tuple[tuple[int, int], ...]


class _Walker:
    """Walk one message, noting the places of numbers."""

    def __init__(self, raw: bytes, types: Types, wanted: set[Path] | None) -> None:
        if raw[:2] not in ORDERS:
            raise CdrError(f'unknown encapsulation {raw[:2].hex() or "(empty)"}')
        self.raw = raw
        self.types = types
        self.wanted = wanted
        self.order = ORDERS[raw[:2]]
        self.position = 4
        self.places: dict[Path, Place] = {}
        self.texts: dict[Path, str] = {}
        self.guards: list[tuple[int, int]] = []

    def is_done(self) -> bool:
        return self.wanted is not None and len(self.places) + len(self.texts) == len(self.wanted)

    def is_wanted(self, path: Path) -> bool:
        return self.wanted is None or path in self.wanted

    def align(self, size: int) -> None:
        self.position += -(self.position - 4) % size

    def need(self, size: int) -> None:
        if size > len(self.raw) - self.position:
            raise CdrError(f'a message of {len(self.raw)} bytes is shorter than its type')

    def length(self) -> int:
        self.align(4)
        self.need(4)
        (value,) = struct.unpack_from(self.order + 'I', self.raw, self.position)
        self.guards.append((self.position, value))
        self.position += 4
        if value > len(self.raw) - self.position:
            raise CdrError(f'a length of {value} in a message of {len(self.raw)} bytes')
        return int(value)

    def value(self, kind: Any, detail: Any, path: Path, depth: int) -> None:
        """Walk one field of any kind."""
        if depth > MAX_DEPTH:
            raise CdrError(f'types nested deeper than {MAX_DEPTH}')
        if kind == Nodetype.BASE:
            self.base(detail[0], path)
        elif kind == Nodetype.NAME:
            self.message(detail, path, depth + 1)
        else:
            element, size = detail
            n = size if kind == Nodetype.ARRAY else self.length()
            self.elements(element, n, path, depth + 1)

    def base(self, name: str, path: Path) -> None:
        if name == 'string':
            n = self.length()
            if self.is_wanted(path):
                text = self.raw[self.position : self.position + n].rstrip(b'\x00')
                self.texts[path] = text.decode('utf-8', 'replace')
            self.position += n
            return
        if name not in NUMBERS:
            raise CdrError(f'fields of type {name} are not read')
        dtype = np.dtype(NUMBERS[name]).newbyteorder(self.order)
        self.align(dtype.itemsize)
        self.need(dtype.itemsize)
        if self.is_wanted(path):
            self.places[path] = Place(self.position, dtype)
        self.position += dtype.itemsize

    def elements(self, element: Any, n: int, path: Path, depth: int) -> None:
        """Walk the elements of an array, numbers in one step."""
        kind, detail = element
        if not n:
            return
        if kind == Nodetype.BASE and detail[0] in NUMBERS:
            dtype = np.dtype(NUMBERS[detail[0]]).newbyteorder(self.order)
            self.align(dtype.itemsize)
            self.need(n * dtype.itemsize)
            for i in self.indices(path, n):
                place = Place(self.position + i * dtype.itemsize, dtype)
                self.places[(*path, i)] = place
            self.position += n * dtype.itemsize
            return
        for i in range(n):
            self.value(kind, detail, (*path, i), depth)
            if self.is_done():
                return

    def indices(self, path: Path, n: int) -> Sequence[int]:
        """Return which elements of an array of numbers are wanted: by default the first 64."""
        if self.wanted is None:
            return range(min(n, 64))
        found = [p[-1] for p in self.wanted if p[:-1] == path and isinstance(p[-1], int)]
        return [int(i) for i in found if int(i) < n]

    def message(self, name: str, path: Path, depth: int) -> None:
        for field, (kind, detail) in fields_of(name, self.types):
            self.value(kind, detail, (*path, field), depth)
            if self.is_done():
                return


def fields_of(name: str, types: Types) -> Sequence[tuple[str, Any]]:
    """Return a type's fields as they are on the wire; raise CdrError where it is not defined."""
    if name not in types:
        raise CdrError(f'the definition of {name} is missing')
    return types[name][1] or EMPTY


def walk(raw: bytes, name: str, types: Types, wanted: set[Path] | None = None) -> Layout:
    """Return the layout of one message: of ``wanted`` paths, or of all that are numbers or text.

    Raises
    ------
    CdrError
        Where the bytes do not fit the type.
    """
    walker = _Walker(raw, types, wanted)
    walker.message(name, (), 0)
    return Layout(walker.places, walker.texts, tuple(walker.guards))


def leaves(raw: bytes, name: str, types: Types) -> dict[Path, float | int | str]:
    """Return every number and text of one message by its path."""
    layout = walk(raw, name, types)
    numbers = {
        path: np.frombuffer(raw, place.dtype, 1, place.offset)[0].item()
        for path, place in layout.places.items()
    }
    return {**numbers, **layout.texts}


def columns(
    rows: Bytes, name: str, types: Types, paths: Sequence[Path]
) -> tuple[list[NDArray[Any]], NDArray[np.bool_]]:
    """Read numbers of many messages of one size.

    Parameters
    ----------
    rows : (n, size) uint8
        The messages.
    name : str
        Their type, defined in ``types``.
    types : mapping
        As `definitions.types_of` gives them.
    paths : sequence of k paths
        What to read.

    Returns
    -------
    columns : k arrays (n,)
        float64, but integers where the field is one.
    is_read : (n,) bool
        False where a message does not fit its type.
    """
    n = len(rows)
    result: list[NDArray[Any] | None] = [None] * len(paths)
    is_read = np.zeros(n, dtype=bool)
    pending = np.arange(n)
    rounds = 0
    while len(pending):
        rounds += 1
        try:
            layout = walk(rows[pending[0]].tobytes(), name, types, set(paths))
            missing = [path for path in paths if path not in layout.places]
            if missing:
                raise CdrError(f'no number at {path_text(missing[0])}')
        except CdrError:
            pending = pending[1:]
            continue
        same = pending[:1] if rounds > MAX_LAYOUTS else _alike(rows, pending, layout)
        for k, path in enumerate(paths):
            place = layout.places[path]
            span = rows[same, place.offset : place.offset + place.dtype.itemsize]
            values = np.ascontiguousarray(span).view(place.dtype)[:, 0]
            kind: Any = np.int64 if place.dtype.kind in 'iu' else np.float64
            column = result[k]
            if column is None:
                column = result[k] = np.zeros(n, dtype=kind)
            column[same] = values
        is_read[same] = True
        pending = pending[~np.isin(pending, same)] if len(same) > 1 else pending[1:]
    return [np.zeros(n) if column is None else column for column in result], is_read


def _alike(rows: Bytes, pending: NDArray[np.int64], layout: Layout) -> NDArray[np.int64]:
    """Return which of ``pending`` have the first one's byte order and lengths."""
    first = rows[pending[0]]
    checked = np.array([0, 1] + [offset + i for offset, _ in layout.guards for i in range(4)])
    return pending[(rows[pending[:, None], checked] == first[checked]).all(axis=1)]
