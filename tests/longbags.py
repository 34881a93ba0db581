"""Bags of hours, written cheaply: the same minute again and again."""

import struct

from makers import (
    definition,
    prototype,
    synthetic,
)
import numpy as np
import zstandard

from escalator_twin.bagfile import mcaprecords, writing
from escalator_twin.bagfile.cdr import walk
from escalator_twin.conversions import STAMP

MACHINE = prototype()
CAMERA = 'std_msgs/msg/String'


def frames(rows, channel, bag_ns):
    """Return MCAP message records, (n, 31 + size) bytes, as numpy writes them."""
    n, size = rows.shape
    made = np.zeros((n, 31 + size), np.uint8)
    made[:, 0] = 5
    for at, values, kind in (
        (1, np.full(n, 22 + size), '<u8'),
        (9, np.full(n, channel), '<u2'),
        (15, bag_ns, '<u8'),
        (23, bag_ns, '<u8'),
    ):
        cells = np.ascontiguousarray(values.astype(kind)[:, None]).view(np.uint8)
        made[:, at : at + cells.shape[1]] = cells
    made[:, 31:] = rows
    return made


def framed(opcode, body):
    return bytes([opcode]) + struct.pack('<Q', len(body)) + body


def text(value):
    data = value.encode()
    return struct.pack('<I', len(data)) + data


class LongWriter:
    """A cheap writer of chunks: no summary, but the message indices that a recorder writes."""

    def __init__(self, path):
        self.file = path.open('wb')
        self.file.write(mcaprecords.MAGIC + framed(1, text('ros2') + text('made')))

    def channel(self, number, topic, kind):
        schema = struct.pack('<H', number) + text(kind) + text('ros2msg') + text(definition(kind))
        self.file.write(framed(3, schema))
        self.file.write(
            framed(4, struct.pack('<HH', number, number) + text(topic) + text('cdr') + bytes(4))
        )

    def head(self, first_ns, last_ns, size, compression, stored):
        head = struct.pack('<QQQI', first_ns, last_ns, size, 0)
        head += text(compression) + struct.pack('<Q', stored)
        self.file.write(bytes([6]) + struct.pack('<Q', len(head) + stored) + head)

    def index(self, number, bag_ns, at):
        entries = np.column_stack([bag_ns, at]).astype('<u8').tobytes()
        self.file.write(framed(7, struct.pack('<HI', number, len(entries)) + entries))

    def chunk(self, topics):
        """Write a chunk of (channel, bag times, rows)."""
        parts_, indices, position = [], [], 0
        for number, bag_ns, rows in topics:
            made = frames(rows, number, bag_ns)
            indices.append((number, bag_ns, position + np.arange(len(made)) * made.shape[1]))
            parts_.append(made.tobytes())
            position += made.size
        data = zstandard.ZstdCompressor(level=1).compress(b''.join(parts_))
        first = min(int(bag_ns.min()) for _, bag_ns, _ in topics)
        last = max(int(bag_ns.max()) for _, bag_ns, _ in topics)
        self.head(first, last, position, 'zstd', len(data))
        self.file.write(data)
        for index in indices:
            self.index(*index)

    def hole(self, number, bag_ns, size):
        """Write a chunk that is a hole in the file: whoever reads it finds no message."""
        self.head(bag_ns, bag_ns, size, '', size)
        self.file.seek(size, 1)
        self.index(number, np.array([bag_ns]), np.array([0]))

    def close(self):
        self.file.write(framed(15, bytes(4)) + framed(2, bytes(20)) + mcaprecords.MAGIC)
        self.file.close()


BLOCK_S = 60


def long_bag(path, duration_s, hole_bytes=0, minute=None):
    """Write the instruments' messages, the same minute again and again; return how many."""
    minute = minute or synthetic(MACHINE, float(BLOCK_S))
    streams = writing._streams(minute, MACHINE, '/measured')
    types = writing.typestore_for({s.type for s in streams}).fielddefs
    writer = LongWriter(path)
    for i, stream in enumerate(streams):
        writer.channel(i + 1, stream.topic, stream.type)
    writer.channel(99, '/camera', CAMERA)
    total = 0
    for k in range(duration_s // BLOCK_S):
        for part in range(6):
            topics_ = []
            for i, stream in enumerate(streams):
                n = len(stream.rows)
                if n == 1 and (k or part):
                    continue
                rows = np.array(stream.rows[part * n // 6 : (part + 1) * n // 6 or None])
                if n == 1:
                    rows = np.array(stream.rows)
                bag_ns = stream.bag_ns[part * n // 6 : part * n // 6 + len(rows)]
                place = walk(rows[0].tobytes(), stream.type, types, set(STAMP)).places[STAMP[0]]
                cells = rows[:, place.offset : place.offset + 4]
                seconds = np.ascontiguousarray(cells).view('<i4') + BLOCK_S * k
                rows[:, place.offset : place.offset + 4] = seconds.astype('<i4').view(np.uint8)
                topics_.append((i + 1, bag_ns + BLOCK_S * k * 10**9, rows))
                total += len(rows)
            writer.chunk(topics_)
            if hole_bytes:
                writer.hole(99, int(topics_[-1][1][-1]), hole_bytes)
    writer.close()
    return total
