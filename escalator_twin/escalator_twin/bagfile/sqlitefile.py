"""Read a rosbag2 sqlite3 file, read-only and as far as it is whole."""

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
import shutil
import sqlite3
import tempfile

import numpy as np

from escalator_twin.bagfile.container import (
    ALWAYS,
    bag_times,
    Block,
    Channel,
    Count,
    count_blocks,
    Damage,
    MAX_CHUNK,
    MAX_TIME,
    Span,
)
from escalator_twin.bagfile.definitions import normalise_type
from escalator_twin.errors import BagError

MAGIC = b'SQLite format 3\x00'
# what a damaged database raises, texts that are no UTF-8 in its own messages included
FAILURES = (sqlite3.Error, UnicodeDecodeError, OverflowError, TypeError, ValueError)
MAX_DATABASE = 1 << 40  # bytes that a cut database may say it had
BATCH = 1 << 20  # bytes of messages that are handed out at once


class SqliteFile:
    """One sqlite3 file of a bag, open for reading.

    Raises
    ------
    BagError
        Where the file is no database or has not rosbag2's tables.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.damage = Damage()
        self.channels: list[Channel] = []
        self._ids: dict[int, int] = {}
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        self._database = self._connect()
        try:
            self._read_topics()
        except FAILURES as error:
            self.close()
            raise BagError(f'{path}: not a rosbag2 database: {error}') from error

    def _connect(self) -> sqlite3.Connection:
        """Open the file; with a log of unfinished writes beside it, as SQLite would."""
        log = self.path.with_name(self.path.name + '-wal')
        modes = ['mode=ro&immutable=1']
        if log.is_file() and log.stat().st_size:
            modes.insert(0, 'mode=ro')
        uri = self.path.resolve().as_uri()
        failure = ''
        for mode in modes:
            try:
                return _open(f'{uri}?{mode}')
            except FAILURES as error:
                failure = str(error)
        if (padded := self._padded()) is not None:
            with suppress(*FAILURES):
                database = _open(f'{padded.as_uri()}?mode=ro&immutable=1')
                self.damage.add('cut off: the messages before are read')
                return database
        self._clean()
        raise BagError(f'{self.path}: not a readable SQLite database: {failure}')

    def _padded(self) -> Path | None:
        """Return a copy of a file that was cut, as long as it says it was; else ``None``.

        SQLite opens no database that is shorter than its header says.
        """
        with self.path.open('rb') as file:
            head = file.read(32)
        page_size = int.from_bytes(head[16:18], 'big')
        page_size = 1 << 16 if page_size == 1 else page_size
        n_bytes = page_size * int.from_bytes(head[28:32], 'big')
        if not self.path.stat().st_size < n_bytes <= MAX_DATABASE:
            return None
        self._folder = tempfile.TemporaryDirectory(prefix='escalator-twin-')
        copy = Path(self._folder.name) / 'cut.db3'
        shutil.copyfile(self.path, copy)
        with copy.open('r+b') as file:
            # half a page would read as rows of zeros
            file.truncate(self.path.stat().st_size // page_size * page_size)
            file.truncate(n_bytes)
        return copy

    def close(self) -> None:
        """Close the file."""
        self._database.close()
        self._clean()

    def _clean(self) -> None:
        if self._folder is not None:
            self._folder.cleanup()

    def _read_topics(self) -> None:
        texts: dict[str, tuple[str, str]] = {}
        with suppress(*FAILURES):  # written since Iron only
            rows = self._database.execute(
                'SELECT topic_type, encoding, encoded_message_definition FROM message_definitions'
            )
            texts = {str(row[0]): (str(row[1]), str(row[2])) for row in rows}
        rows = self._database.execute('SELECT id, name, type, serialization_format FROM topics')
        for number, name, kind, serialization in rows:
            encoding, text = texts.get(str(kind), ('', ''))
            self._ids[int(number)] = len(self.channels)
            self.channels.append(
                Channel(str(name), normalise_type(str(kind)), str(serialization), encoding, text)
            )

    def blocks(self, topics: set[str] | None, span: Span = ALWAYS) -> Iterator[Block]:
        """Yield the messages of ``topics`` (``None``: all) in ``span``, the rest unread."""
        wanted = [
            number
            for number, index in self._ids.items()
            if topics is None or self.channels[index].topic in topics
        ]
        batch: list[tuple[int, int, bytes]] = []
        n_bytes = 0
        for row in self._rows(wanted, span):
            batch.append(row)
            n_bytes += len(row[2])
            if n_bytes > BATCH:
                yield self._block(batch)
                batch, n_bytes = [], 0
        if batch:
            yield self._block(batch)

    def _rows(self, wanted: list[int], span: Span) -> Iterator[tuple[int, int, bytes]]:
        """Yield messages one by one, as far as the database is whole."""
        marks = ','.join('?' * len(wanted))
        # times beyond what is believed are moved to its ends: so an open end takes them all
        limits = ''
        if span.from_ns > 0:
            limits += f' AND timestamp >= {int(span.from_ns)}'
        if span.to_ns <= MAX_TIME:
            limits += f' AND timestamp < {int(span.to_ns)}'
        try:
            yield from self._database.execute(
                'SELECT topic_id, timestamp, CAST(data AS BLOB) FROM messages '
                f'WHERE topic_id IN ({marks}) AND length(data) < {MAX_CHUNK} '
                f"AND typeof(timestamp) = 'integer'{limits}",
                wanted,
            )
        except FAILURES as error:
            self.damage.add(f'damaged: {error}: all before it is read')

    def _block(self, rows: list[tuple[int, int, bytes]]) -> Block:
        parts = [row[2] for row in rows]
        size = np.array([len(part) for part in parts], dtype=np.int64)
        return Block(
            b''.join(parts),
            np.array([self._ids[row[0]] for row in rows], dtype=np.int64),
            bag_times([row[1] for row in rows]),
            np.cumsum(size) - size,
            size,
        )

    def counts(self) -> dict[int, Count]:
        """Return how many messages each channel has."""
        found: dict[int, Count] = {}
        try:
            rows = self._database.execute(
                'SELECT topic_id, count(*), min(timestamp), max(timestamp) '
                'FROM messages GROUP BY topic_id'
            )
            for number, n, first, last in rows:
                if number in self._ids:
                    found[self._ids[number]] = Count(
                        int(n), *(int(t) for t in bag_times([first, last]))
                    )
        except FAILURES:
            return count_blocks(self.blocks(None))
        return found


def _open(uri: str) -> sqlite3.Connection:
    database = sqlite3.connect(uri, uri=True)
    try:
        database.execute('SELECT count(*) FROM sqlite_master').fetchone()
    except BaseException:
        database.close()
        raise
    database.text_factory = lambda raw: raw.decode('utf-8', 'replace')
    return database
