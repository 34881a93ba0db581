"""Decompression that is bounded in memory and keeps what a cut stream still gives."""

from collections.abc import Callable
import io

import lz4.frame
import zstandard

ZSTD_MAGIC = b'\x28\xb5\x2f\xfd'
FAILURES = (zstandard.ZstdError, RuntimeError, ValueError, EOFError, MemoryError)


def _zstd(data: bytes, limit: int) -> bytes:
    stream = zstandard.ZstdDecompressor().stream_reader(io.BytesIO(data), read_across_frames=True)
    parts = []
    left = limit
    try:
        while left > 0:
            part = stream.read(min(left, 1 << 20))
            if not part:
                break
            parts.append(part)
            left -= len(part)
    except zstandard.ZstdError as error:
        raise CutError(b''.join(parts), str(error)) from error
    return b''.join(parts)


def _lz4(data: bytes, limit: int) -> bytes:
    machine = lz4.frame.LZ4FrameDecompressor()
    try:
        return machine.decompress(data, max_length=limit)
    except RuntimeError as error:
        raise CutError(b'', str(error)) from error


class CutError(Exception):
    """A stream that ends in damage; ``data`` is what came before it."""

    def __init__(self, data: bytes, reason: str) -> None:
        """Keep what was read and why it ends."""
        super().__init__(reason)
        self.data = data


DECOMPRESSORS: dict[str, Callable[[bytes, int], bytes]] = {
    '': lambda data, limit: data[:limit],
    'none': lambda data, limit: data[:limit],
    'lz4': _lz4,
    'zstd': _zstd,
}


def decompress(data: bytes, compression: str, size: int) -> bytes:
    """Return at most ``size + 1`` bytes of what ``data`` holds; raise `CutError` on damage."""
    return DECOMPRESSORS[compression](data, size + 1)
