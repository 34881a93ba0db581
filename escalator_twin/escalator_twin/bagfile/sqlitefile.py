"""Read a rosbag2 sqlite3 file, read-only and as far as it is whole."""

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
import sqlite3

import numpy as np

from escalator_twin.bagfile.container import Block, Channel, Count, Damage, MAX_CHUNK
from escalator_twin.bagfile.definitions import normalise_type
from escalator_twin.errors import BagError

MAGIC = b'SQLite format 3\x00'
BATCH = 4096  # messages that are handed out at once


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
        self._database = self._connect()
        try:
            self._read_topics()
        except sqlite3.Error as error:
            self._database.close()
            raise BagError(f'{path}: not a rosbag2 database: {error}') from error

    def _connect(self) -> sqlite3.Connection:
        """Open the file; with a log of unfinished writes beside it, as SQLite would."""
        log = self.path.with_name(self.path.name + '-wal')
        modes = ['mode=ro&immutable=1']
        if log.is_file() and log.stat().st_size:
            modes.insert(0, 'mode=ro')
        uri = self.path.resolve().as_uri()
        for mode in modes:
            try:
                database = sqlite3.connect(f'{uri}?{mode}', uri=True)
                database.execute('SELECT count(*) FROM sqlite_master').fetchone()
            except sqlite3.Error as error:
                failure = error
            else:
                database.text_factory = lambda raw: raw.decode('utf-8', 'replace')
                return database
        raise BagError(f'{self.path}: not a readable SQLite database: {failure}')

    def close(self) -> None:
        """Close the file."""
        self._database.close()

    def _read_topics(self) -> None:
        texts: dict[str, tuple[str, str]] = {}
        with suppress(sqlite3.Error):  # written since Iron only
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

    def blocks(self, topics: set[str] | None) -> Iterator[Block]:
        """Yield the messages of ``topics`` (``None``: all), skipping the rest unread."""
        wanted = [
            number
            for number, index in self._ids.items()
            if topics is None or self.channels[index].topic in topics
        ]
        marks = ','.join('?' * len(wanted))
        cursor = self._database.cursor()
        try:
            cursor.execute(
                'SELECT topic_id, timestamp, data FROM messages '
                f'WHERE topic_id IN ({marks}) AND length(data) < {MAX_CHUNK}',
                wanted,
            )
            while rows := cursor.fetchmany(BATCH):
                yield self._block(rows)
        except (sqlite3.Error, OverflowError, TypeError, ValueError) as error:
            self.damage.add(f'damaged: {error}: all before it is read')

    def _block(self, rows: list[tuple[int, int, bytes]]) -> Block:
        parts = [row[2] if isinstance(row[2], bytes) else b'' for row in rows]
        size = np.array([len(part) for part in parts], dtype=np.int64)
        return Block(
            b''.join(parts),
            np.array([self._ids[row[0]] for row in rows], dtype=np.int64),
            np.array([row[1] for row in rows], dtype=np.int64),
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
                    found[self._ids[number]] = Count(int(n), int(first), int(last))
        except (sqlite3.Error, TypeError, ValueError) as error:
            self.damage.add(f'damaged: {error}: messages are not all counted')
        return found
