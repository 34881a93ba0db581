"""Read an MCAP file from front to back, whatever its state.

The data section alone is read, record by record, so that a file without index, summary or footer
reads like any other. Chunks whose message index names none of the wanted channels are passed
over undecompressed.
"""

from collections.abc import Iterator
from pathlib import Path
import struct
from typing import NamedTuple
from zlib import crc32

import numpy as np

from escalator_twin.bagfile.compression import CutError, decompress, DECOMPRESSORS
from escalator_twin.bagfile.container import (
    ALWAYS,
    bag_times,
    Block,
    Channel,
    Count,
    count_blocks,
    Damage,
    Indices,
    MAX_CHUNK,
    MAX_SCHEMA,
    NOTHING,
    Span,
)
from escalator_twin.bagfile.definitions import normalise_type
from escalator_twin.bagfile.mcaprecords import (
    CHANNEL,
    CHUNK,
    Cursor,
    DamagedError,
    HEADER,
    KNOWN,
    MESSAGE,
    PREFIX,
    RecordFile,
    SCHEMA,
)

FRAME = np.dtype(
    [
        ('opcode', 'u1'),
        ('length', '<u8'),
        ('channel', '<u2'),
        ('sequence', '<u4'),
        ('log_time', '<u8'),
        ('publish_time', '<u8'),
    ]
)
BATCH = 1 << 20  # bytes of unchunked messages that are handed out at once


class _ChunkHead(NamedTuple):
    """What stands before a chunk's messages."""

    size: int
    crc: int
    compression: str
    stored: int
    start: int  # of the stored bytes in the file


class McapFile:
    """One MCAP file, open for reading.

    Raises
    ------
    BagError
        Where the file is not MCAP at all.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.channels: list[Channel] = []
        self.damage = Damage()
        self._file = RecordFile(path, self.damage)
        self._schemas: dict[int, tuple[str, str, str]] = {}
        self._ids: dict[int, int] = {}  # channel id -> index into channels

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    # schemas and channels

    def _begin(self) -> None:
        """Forget the schemas and channels of a file before this one in the same file."""
        self._schemas.clear()
        self._ids.clear()

    def _define(self, opcode: int, data: bytes) -> None:
        """Keep a schema or a channel; a repeated one replaces the earlier."""
        cursor = Cursor(data)
        if opcode == SCHEMA:
            number = cursor.number(2)
            self._schemas[number] = (cursor.text(), cursor.text(), cursor.text())
            return
        number, schema = cursor.number(2), cursor.number(2)
        topic, encoding = cursor.text(), cursor.text()
        name, kind, text = self._schemas.get(schema, ('', '', ''))
        channel = Channel(topic, normalise_type(name), encoding, kind, text)
        if channel not in self.channels:
            self.channels.append(channel)
        self._ids[number] = self.channels.index(channel)

    def _try_define(self, opcode: int, data: bytes, where: int) -> None:
        try:
            self._define(opcode, data)
        except DamagedError as error:
            self.damage.add(f'byte {where}: {error}')

    # chunks

    def _chunk_head(self, start: int, length: int) -> _ChunkHead:
        cursor = Cursor(self._file.body(start, min(length, 4096)))
        cursor.take(16)
        size, crc = cursor.number(8), cursor.number(4)
        compression, stored = cursor.text(), cursor.number(8)
        if size > MAX_CHUNK or stored > MAX_CHUNK:
            raise DamagedError(f'a chunk says it has {size} bytes')
        if compression not in DECOMPRESSORS:
            raise DamagedError(f'unknown compression {compression!r}')
        return _ChunkHead(size, crc, compression, stored, start + cursor.position)

    def _chunk_data(self, start: int, length: int) -> bytes:
        """Return a chunk's records decompressed; what there is of them where the file ends."""
        head = self._chunk_head(start, length)
        available = start + length - head.start
        is_cut = head.stored > available
        try:
            stored = self._file.body(head.start, min(head.stored, available))
            data = decompress(stored, head.compression, head.size)
        except CutError as cut:
            if not is_cut:
                raise DamagedError(f'a chunk does not decompress: {cut}') from cut
            return cut.data
        if is_cut:
            return data
        if len(data) != head.size:
            raise DamagedError(f'a chunk says {head.size} bytes and has {len(data)}')
        if head.crc and crc32(data) != head.crc:
            raise DamagedError('a chunk fails its checksum')
        return data

    def _chunk(self, start: int, length: int) -> Block:
        """Read one chunk, its schemas and channels included."""
        data = self._chunk_data(start, length)
        unpack = struct.Struct('<Q').unpack_from
        position, end, found = 0, len(data), []
        while position + PREFIX <= end:
            (size,) = unpack(data, position + 1)
            behind = position + PREFIX + size
            if behind > end:
                break
            opcode = data[position]
            if opcode == MESSAGE:
                if size < 22:
                    raise DamagedError('a message shorter than its own head')
                found.append(position)
            elif opcode in (SCHEMA, CHANNEL):
                self._try_define(opcode, data[position + PREFIX : behind], start)
            position = behind
        if position != end:
            self.damage.add(f'byte {start}: a chunk ends inside a message')
        return self._block(data, np.array(found, dtype=np.int64))

    def _block(self, data: bytes, positions: Indices) -> Block:
        """Take the messages at ``positions`` of ``data`` apart."""
        width = FRAME.itemsize
        if not len(positions):
            return Block(data, *(np.zeros(0, np.int64) for _ in range(4)))
        windows = np.lib.stride_tricks.sliding_window_view(np.frombuffer(data, np.uint8), width)
        frames = np.ascontiguousarray(windows[positions]).view(FRAME)[:, 0]
        table = np.full(1 << 16, -1, dtype=np.int64)
        for number, index in self._ids.items():
            table[number] = index
        channel = table[frames['channel']]
        if (channel < 0).any():
            self.damage.add('messages of a channel that is nowhere declared are left out')
        keep = channel >= 0
        size = frames['length'].astype(np.int64) - (width - PREFIX)
        return Block(
            data,
            channel[keep],
            bag_times(frames['log_time'].view('<i8'))[keep],
            (positions + width)[keep],
            size[keep],
        )

    # the storage protocol

    def blocks(self, topics: set[str] | None, span: Span = ALWAYS) -> Iterator[Block]:
        """Yield the messages of ``topics`` (``None``: all), skipping the rest unread.

        Chunks whose head says that they lie outside ``span`` are skipped as well.
        """
        loose = _Loose()
        for opcode, start, length in self._file.records():
            if loose.size > BATCH or (loose.size and opcode in (HEADER, CHANNEL)):
                yield self._block(*loose.take())
            if opcode == HEADER:
                self._begin()
            elif opcode in (SCHEMA, CHANNEL):
                if length <= MAX_SCHEMA:
                    self._try_define(opcode, self._file.body(start, length), start)
            elif opcode == CHUNK:
                if self._is_wanted(start, length, topics, span):
                    yield from self._safe_chunk(start, length)
            elif opcode == MESSAGE and 22 <= length <= MAX_CHUNK:
                if self._is_loose_wanted(start, topics, span):
                    loose.add(self._file.body(start - PREFIX, PREFIX + length))
            elif opcode not in KNOWN and opcode < 128:
                self.damage.remark(f'byte {start}: unknown kind of record {opcode}')
        if loose.size:
            yield self._block(*loose.take())

    def _is_wanted(self, start: int, length: int, topics: set[str] | None, span: Span) -> bool:
        """Tell whether a chunk may hold a message of ``topics`` in ``span``, or a new channel."""
        if topics is None and span == ALWAYS:
            return True
        indexed = self._file.indexed(start + length)
        if not indexed or any(number not in self._ids for number in indexed):
            return True
        if span != ALWAYS:
            first, last = bag_times(np.frombuffer(self._file.body(start, 16), '<i8'))
            # a writer that leaves the times out puts zeros
            if 0 < first <= last and not span.meets(int(first), int(last)):
                return False
        if topics is None:
            return True
        return any(self.channels[self._ids[number]].topic in topics for number in indexed)

    def _is_loose_wanted(self, start: int, topics: set[str] | None, span: Span) -> bool:
        """Tell whether a message outside chunks is one of ``topics`` in ``span``."""
        head = self._file.body(start, 14)
        index = self._ids.get(int.from_bytes(head[:2], 'little'), -1)
        time = int(bag_times(np.frombuffer(head[6:], '<i8'))[0])
        if not span.meets(time, time):
            return False
        return index < 0 or topics is None or self.channels[index].topic in topics

    def _safe_chunk(self, start: int, length: int) -> Iterator[Block]:
        try:
            yield self._chunk(start, length)
        except DamagedError as error:
            self.damage.add(f'byte {start}: {error}: its messages are lost')

    def counts(self) -> dict[int, Count]:
        """Return how many messages each channel has, from the indices where there are any."""
        totals: dict[int, Count] = {}

        def add(index: int, count: Count) -> None:
            totals[index] = totals.get(index, NOTHING) + count

        for opcode, start, length in self._file.records():
            if opcode == HEADER:
                self._begin()
            elif opcode in (SCHEMA, CHANNEL) and length <= MAX_SCHEMA:
                self._try_define(opcode, self._file.body(start, length), start)
            elif opcode == MESSAGE and length >= 22:
                head = self._file.body(start, 14)
                if (index := self._ids.get(int.from_bytes(head[:2], 'little'))) is not None:
                    time = int(bag_times(np.frombuffer(head[6:], '<i8'))[0])
                    add(index, Count(1, time, time))
            elif opcode == CHUNK:
                indexed = self._file.indexed(start + length)
                if indexed and all(number in self._ids for number in indexed):
                    for number, (at, size) in indexed.items():
                        times = bag_times(np.frombuffer(self._file.body(at, size), '<i8')[::2])
                        count = Count(len(times), int(times.min()), int(times.max()))
                        add(self._ids[number], count)
                    continue
                for index, count in count_blocks(self._safe_chunk(start, length)).items():
                    add(index, count)
        return totals


class _Loose:
    """Messages outside chunks, gathered until they make a block."""

    def __init__(self) -> None:
        self.parts: list[bytes] = []
        self.size = 0

    def add(self, record: bytes) -> None:
        self.parts.append(record)
        self.size += len(record)

    def take(self) -> tuple[bytes, Indices]:
        lengths = np.array([len(part) for part in self.parts], dtype=np.int64)
        data = b''.join(self.parts)
        self.parts, self.size = [], 0
        return data, np.cumsum(lengths) - lengths
