"""The records of an MCAP file, outside chunks, as far as they hold together.

The layout is that of https://mcap.dev/spec (version 0): a magic, records of an opcode, a length and
a body, the magic again.
"""

from collections.abc import Iterator
from pathlib import Path
import struct
from typing import BinaryIO

from escalator_twin.bagfile.container import Damage, MAX_CHUNK
from escalator_twin.errors import BagError

MAGIC = b'\x89MCAP0\r\n'
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, INDEX, CHUNK_INDEX = 1, 2, 3, 4, 5, 6, 7, 8
KNOWN = range(1, 16)
PREFIX = 9  # opcode and length of a record, bytes
FOOTER_SIZE = PREFIX + 20


class DamagedError(Exception):
    """A record that does not hold what its kind should."""


class Cursor:
    """Read fields of one record."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.position = 0

    def take(self, n: int) -> bytes:
        if n > len(self.data) - self.position:
            raise DamagedError(f'a record ends {n} bytes early')
        self.position += n
        return self.data[self.position - n : self.position]

    def number(self, n: int) -> int:
        return int.from_bytes(self.take(n), 'little')

    def text(self) -> str:
        return self.take(self.number(4)).decode('utf-8', 'replace')


class RecordFile:
    """One MCAP file, open for reading.

    Raises
    ------
    BagError
        Where the file is not MCAP at all.
    """

    def __init__(self, path: Path, damage: Damage) -> None:
        self.path = path
        self.damage = damage
        self._file: BinaryIO = path.open('rb', buffering=1 << 16)
        self._size = path.stat().st_size
        if self._file.read(len(MAGIC)) != MAGIC:
            self._file.close()
            raise BagError(f'{path}: not an MCAP file: its first bytes are not the magic')

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def records(self) -> Iterator[tuple[int, int, int]]:
        """Yield opcode, start and length of every record outside chunks, seeking over bodies."""
        position = last = len(MAGIC)
        while position < self._size:
            self._file.seek(position)
            head = self._file.read(PREFIX)
            if head[: len(MAGIC)] == MAGIC:  # another file behind this one
                self.damage.remark('several MCAP files in one: all are read')
                position += len(MAGIC)
                continue
            opcode = head[0]
            length = int.from_bytes(head[1:], 'little')
            start = position + PREFIX
            if len(head) == PREFIX and opcode and start + length <= self._size:
                yield opcode, start, length
                last, position = position, start + length
                if opcode == FOOTER:
                    position = self._behind_footer(position)
                continue
            later = self._rescue(last, position)
            if later is None and len(head) == PREFIX and opcode == CHUNK:
                yield opcode, start, self._size - start  # what is left of a cut chunk
            where = f'damaged or cut off at byte {position} of {self._size}'
            if later is None:
                self.damage.add(f'{where}: all before it is read')
                return
            self.damage.add(f'{where}: read on at byte {later}')
            last = position = later

    def _rescue(self, last: int, position: int) -> int | None:
        """Return where to read on behind damage, ``None`` where there is nothing more.

        That is the next chunk by the summary, or the begin of another file, which the last whole
        record may have run over.
        """
        found = [offset for offset in self._chunk_offsets() if offset > position]
        if (magic := self._next_file(last)) is not None:
            found.append(magic)
        return min(found, default=None)

    def _next_file(self, position: int) -> int | None:
        """Return where the next magic with a header behind it stands."""
        sought = MAGIC + bytes([HEADER])
        self._file.seek(position)
        behind = b''
        while block := self._file.read(1 << 20):
            data = behind + block
            if (at := data.find(sought)) >= 0:
                return position - len(behind) + at
            position += len(block)
            behind = data[-len(sought) + 1 :]
        return None

    def _behind_footer(self, position: int) -> int:
        """Return where to read on behind a footer: the closing magic is passed over."""
        self._file.seek(position)
        if self._file.read(len(MAGIC)) != MAGIC:
            self.damage.remark('the closing magic is missing')
            return self._size
        position += len(MAGIC)
        if position < self._size and self._file.read(len(MAGIC)) != MAGIC:
            self.damage.remark(f'{self._size - position} bytes behind the end are not MCAP')
            return self._size
        return position

    def _has_footer(self) -> bool:
        self._file.seek(max(0, self._size - len(MAGIC)))
        return self._file.read() == MAGIC

    def _chunk_offsets(self) -> list[int]:
        """Return the chunks' offsets by the summary at the end, empty where there is none."""
        if self._size < 37 + len(MAGIC) or not self._has_footer():
            return []
        self._file.seek(self._size - 37)
        opcode, length, summary, _, _ = struct.unpack('<BQQQI', self._file.read(29))
        if opcode != FOOTER or length != 20 or not len(MAGIC) <= summary < self._size:
            return []
        self._file.seek(summary)
        data = self._file.read(min(self._size - summary, MAX_CHUNK))
        offsets, position = [summary], 0
        while position + PREFIX <= len(data):
            opcode, length = (
                data[position],
                int.from_bytes(data[position + 1 : position + 9], 'little'),
            )
            if opcode == CHUNK_INDEX and length >= 24:
                at = position + PREFIX + 16
                offsets.append(int.from_bytes(data[at : at + 8], 'little'))
            position += PREFIX + length
        return sorted(offset for offset in offsets if offset < self._size)

    def body(self, start: int, length: int) -> bytes:
        self._file.seek(start)
        return self._file.read(length)

    def indexed(self, position: int) -> dict[int, tuple[int, int]]:
        """Return channel id -> start and length of the index arrays that follow a chunk."""
        found = {}
        while position + PREFIX + 6 <= self._size:
            head = self.body(position, PREFIX + 6)
            length = int.from_bytes(head[1:9], 'little')
            if head[0] != INDEX or position + PREFIX + length > self._size:
                break
            entries = int.from_bytes(head[11:15], 'little')
            if entries > length - 6 or entries % 16:
                return {}
            if entries:
                number = int.from_bytes(head[9:11], 'little')
                found[number] = (position + PREFIX + 6, entries)
            position += PREFIX + length
        return found
