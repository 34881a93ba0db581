"""A bag as one thing: a directory of files or a bare file, whatever the storage."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
import os
from pathlib import Path
import re
import tempfile
from types import TracebackType
from typing import Any, NamedTuple

import yaml
import zstandard

from escalator_twin.bagfile.compression import ZSTD_MAGIC
from escalator_twin.bagfile.container import (
    ALWAYS,
    Block,
    Channel,
    Count,
    NOTHING,
    Span,
    StorageFile,
)
from escalator_twin.bagfile.definitions import normalise_type
from escalator_twin.bagfile.mcapfile import McapFile
from escalator_twin.bagfile.mcaprecords import MAGIC as MCAP_MAGIC
from escalator_twin.bagfile.sqlitefile import MAGIC as SQLITE_MAGIC
from escalator_twin.bagfile.sqlitefile import SqliteFile
from escalator_twin.errors import BagError

METADATA = 'metadata.yaml'
MAX_METADATA = 16 << 20  # bytes
STORAGE: dict[bytes, Callable[[Path], StorageFile]] = {
    MCAP_MAGIC: McapFile,
    SQLITE_MAGIC: SqliteFile,
}
SUFFIXES = re.compile(r'\.(mcap|db3)(\.zstd|\.zst)?$')


class TopicInfo(NamedTuple):
    """One topic of a bag; the times are the bag's, 0 where there is no message."""

    topic: str
    type: str
    n_messages: int
    first_ns: int
    last_ns: int
    serialization: str


class Metadata(NamedTuple):
    """What is used of a metadata.yaml."""

    files: tuple[str, ...]
    message_compression: str
    message_count: int | None


class Bag:
    """An open bag; a context manager.

    Attributes
    ----------
    path : Path
        As the user gave it.
    notes, losses : list of str
        What is odd about the container, and what of it could not be read; grow while reading.

    Raises
    ------
    BagError
        Where nothing can be read.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        self.notes: list[str] = []
        self.losses: list[str] = []
        self.message_compression = ''
        self.message_count: int | None = None
        self._stack = ExitStack()
        self.files: list[StorageFile] = []
        self.paths: list[Path] = []
        try:
            self.paths = self._find()
            for file in self.paths:
                self._open(file)
        except OSError as error:
            self._stack.close()
            raise BagError(f'{error.filename or path}: {error.strerror or error}') from error
        except BagError:
            self._stack.close()
            raise
        if not self.files:
            raise BagError(f'{path}: none of the files of this bag can be read: {self.losses[-1]}')

    def __enter__(self) -> 'Bag':
        """Return the open bag."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close all files."""
        self._stack.close()

    def _find(self) -> list[Path]:
        """Return the storage files in their order."""
        path = self.path
        if path.is_file():
            return [path]
        if not path.is_dir():
            reason = 'neither a file nor a directory' if path.exists() else 'no such file'
            raise BagError(f'{path}: {reason}')
        present = sorted(
            (p for p in path.iterdir() if SUFFIXES.search(p.name) and p.is_file()), key=_natural
        )
        metadata = self._metadata(path / METADATA)
        if metadata is not None:
            self.message_compression = metadata.message_compression
            self.message_count = metadata.message_count
            listed = [path / Path(name).name for name in metadata.files]
            for file in listed:
                if not file.is_file():
                    self.losses.append(f'{METADATA} names {file.name}, which is not there')
            found = [file for file in listed if file.is_file()]
            if found:
                return found
        if not present:
            raise BagError(f'{path}: no bag in this directory: no .mcap or .db3 file')
        return present

    def _metadata(self, path: Path) -> Metadata | None:
        if not path.is_file():
            self.notes.append(f'no {METADATA}: files are taken in the order of their names')
            return None
        try:
            if path.stat().st_size > MAX_METADATA:
                raise ValueError('too large')
            data: Any = yaml.load(path.read_bytes(), Loader=_LOADER)
            return _parse_metadata(data)
        except (yaml.YAMLError, RecursionError, ValueError, TypeError, KeyError) as error:
            reason = ' '.join(str(error).split())[:120]
            self.notes.append(f'{METADATA} cannot be read ({reason})')
            return None

    def _open(self, file: Path) -> None:
        """Open one storage file; with several, an unreadable one is a note."""
        try:
            self.files.append(self._storage(file))
            self._stack.callback(self.files[-1].close)
        except BagError as error:
            if self.path.is_file():
                raise
            self.losses.append(str(error))

    def _storage(self, file: Path) -> StorageFile:
        head = _head(file)
        if head.startswith(ZSTD_MAGIC):
            file, named = self._unpack(file), file
            head = _head(file)
            self.notes.append(f'{named.name} is compressed as a whole')
        for magic, kind in STORAGE.items():
            if head.startswith(magic):
                return kind(file)
        if not head:
            raise BagError(f'{file}: empty file')
        if head.startswith(b'#ROSBAG V'):
            raise BagError(f'{file}: a bag of ROS 1; convert it with rosbags-convert first')
        raise BagError(f'{file}: neither MCAP nor SQLite3: begins with {head[:8]!r}')

    def _unpack(self, file: Path) -> Path:
        """Decompress a file as rosbag2's compression mode FILE writes it, to a temporary one."""
        folder = self._stack.enter_context(tempfile.TemporaryDirectory(prefix='escalator-twin-'))
        target = Path(folder) / SUFFIXES.sub(r'.\1', file.name)
        try:
            with file.open('rb') as source, target.open('wb') as sink:
                zstandard.ZstdDecompressor().copy_stream(source, sink)
        except zstandard.ZstdError as error:
            self.losses.append(f'{file.name}: damaged compression: {error}')
        return target

    # what the bag holds

    def blocks(
        self, topics: set[str] | None, span: Span = ALWAYS
    ) -> Iterator[tuple[StorageFile, Block]]:
        """Yield the messages of ``topics`` (``None``: all), file by file.

        What lies outside ``span`` is skipped as far as the files tell; some of it may be given.
        """
        for file in self.files:
            for block in file.blocks(topics, span):
                yield file, block
            self._take_notes(file)

    def counts(self) -> dict[Channel, Count]:
        """Return how many messages each channel has, over all files, in order of appearance."""
        totals: dict[Channel, Count] = {}
        for file in self.files:
            found = file.counts()
            for index, channel in enumerate(file.channels):
                totals[channel] = totals.get(channel, NOTHING) + found.get(index, NOTHING)
            self._take_notes(file)
        return totals

    def _take_notes(self, file: StorageFile) -> None:
        name = getattr(file, 'path', self.path).name
        for kept, new in (
            (self.notes, file.damage.remarks),
            (self.losses, file.damage.losses),
        ):
            kept += [text for note in new if (text := f'{name}: {note}') not in kept]


def topics(path: str | os.PathLike[str]) -> list[TopicInfo]:
    """List a bag's topics without reading their messages.

    Raises
    ------
    BagError
        Where the container cannot be read.
    """
    with Bag(path) as bag:
        return topics_of(bag)


def topics_of(bag: Bag) -> list[TopicInfo]:
    """List an open bag's topics; one whose channels differ in type or encoding comes twice."""
    found: dict[tuple[str, str, str], Count] = {}
    for channel, count in bag.counts().items():
        key = (channel.topic, channel.type, channel.serialization)
        found[key] = found.get(key, NOTHING) + count
    return [
        TopicInfo(topic, kind, n.n, n.first_ns, n.last_ns, serialization)
        for (topic, kind, serialization), n in found.items()
    ]


def _parse_metadata(data: Any) -> Metadata:
    if isinstance(data, dict):
        data = data.get('rosbag2_bagfile_information', data)
    if not isinstance(data, dict):
        raise ValueError('not a mapping')
    files = data.get('relative_file_paths') or []
    if not isinstance(files, list) or not all(isinstance(name, str) for name in files):
        raise ValueError('relative_file_paths is no list of names')
    mode = str(data.get('compression_mode') or '').lower()
    count = data.get('message_count')
    return Metadata(
        tuple(files),
        str(data.get('compression_format') or '').lower() if mode == 'message' else '',
        count if isinstance(count, int) else None,
    )


def _head(file: Path) -> bytes:
    with file.open('rb') as stream:
        return stream.read(16)


def _natural(path: Path) -> list[tuple[int, str]]:
    """Sort key: ``bag_2`` before ``bag_10``."""
    return [
        (int(part), '') if part.isdigit() else (-1, part) for part in re.split(r'(\d+)', path.name)
    ]


_LOADER = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)

__all__ = ['Bag', 'TopicInfo', 'normalise_type', 'topics', 'topics_of']
