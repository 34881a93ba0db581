"""Damaged files: what can be read is read, and no kind of damage ends in a traceback."""

from collections.abc import Iterator
from pathlib import Path
import sqlite3
import struct

from makers import (
    mcap_bytes,
    message,
    prototype,
    raw,
    START_NS,
    STORE,
    strain_messages,
    write_mcap,
)
from mcap.writer import CompressionType
import numpy as np
import pytest

from escalator_twin import bagfile
from escalator_twin.bagfile.source import Bag, topics_of
from escalator_twin.errors import BagError

pytestmark = pytest.mark.issue(2)

MACHINE = prototype()
LEFT_A = 'link_force/left_a'
SCALE = 7.56e7 * 1e-6
N = 150


def read_values(path: Path) -> np.ndarray:
    """Return which of the messages 0, 1, 2, ... were read."""
    recording = bagfile.read(path, MACHINE)
    if LEFT_A not in recording.signals:
        return np.zeros(0)
    return recording.signals[LEFT_A].values / SCALE - 1.5


def losses(path: Path) -> str:
    with Bag(path) as bag:
        for _ in bag.blocks(None):
            pass
        return ' '.join(bag.losses)


def chunks(data: bytes) -> Iterator[tuple[int, int]]:
    """Yield begin and length of each chunk record: the plain way, record by record."""
    position = 8
    while data[position : position + 8] != data[:8]:
        (length,) = struct.unpack_from('<Q', data, position + 1)
        if data[position] == 6:
            yield position, length + 9
        position += 9 + length


@pytest.mark.parametrize('layout', ['zstd', 'lz4', 'none', 'unchunked'])
def test_a_cut_file_gives_all_before_the_cut(tmp_path, layout):
    options = {
        'zstd': {'compression': CompressionType.ZSTD, 'chunk_size': 1500},
        'lz4': {'compression': CompressionType.LZ4, 'chunk_size': 1500},
        'none': {'compression': CompressionType.NONE, 'chunk_size': 1500},
        'unchunked': {'use_chunking': False},
    }[layout]
    data = mcap_bytes(strain_messages(N), **options)
    path = tmp_path / 'a.mcap'
    rng = np.random.default_rng(2)
    before = 0
    for end in sorted(rng.integers(60, len(data), 25)):
        path.write_bytes(data[:end])
        k = read_values(path)
        assert k == pytest.approx(np.arange(len(k)))  # a beginning, nothing left out
        assert len(k) >= before
        before = len(k)
        whole = sum(1 for begin, length in chunks(data) if begin + length <= end)
        if layout != 'unchunked':
            assert len(k) >= 14 * whole - 8  # 14 messages a chunk, the first with a schema
    assert before > N / 2


def test_a_cut_is_a_finding(tmp_path):
    path = tmp_path / 'a.mcap'
    data = mcap_bytes(strain_messages(N), chunk_size=1500)
    path.write_bytes(data[: len(data) // 2])
    (finding,) = [f for f in bagfile.read(path, MACHINE).findings if f.kind == 'data_gap']
    assert 'a.mcap' in finding.detail
    assert 'cut off at byte' in finding.detail


def test_messages_of_an_open_chunk_are_read(tmp_path):
    """A recorder that died: its last chunk is on disk in part, without index and footer."""
    data = mcap_bytes(strain_messages(N), compression=CompressionType.NONE)
    (begin, length) = next(chunks(data))
    path = tmp_path / 'a.mcap'
    path.write_bytes(data[: begin + length // 2])
    assert N / 3 < len(read_values(path)) < N / 2 + 2


def test_only_the_chunk_with_a_wrong_checksum_is_lost(tmp_path):
    data = bytearray(
        mcap_bytes(strain_messages(N), chunk_size=1500, compression=CompressionType.NONE)
    )
    begin, length = list(chunks(bytes(data)))[4]
    data[begin + length - 40] ^= 1
    path = tmp_path / 'a.mcap'
    path.write_bytes(data)
    k = read_values(path)
    missing = sorted(set(range(N)) - set(np.rint(k).astype(int)))
    assert 10 <= len(missing) <= 16
    assert np.ptp(missing) == len(missing) - 1
    assert 'checksum' in losses(path)


def test_reads_on_behind_a_damaged_length(tmp_path):
    data = bytearray(mcap_bytes(strain_messages(N), chunk_size=1500))
    begin, _ = list(chunks(bytes(data)))[4]
    data[begin + 1 : begin + 9] = struct.pack('<Q', 1 << 60)
    path = tmp_path / 'a.mcap'
    path.write_bytes(data)
    k = read_values(path)
    assert len(k) > N - 20
    assert k[-1] == pytest.approx(N - 1)
    assert 'read on at byte' in losses(path)


def test_unknown_compression_is_a_loss(tmp_path):
    data = mcap_bytes(strain_messages(N)).replace(b'\x04\x00\x00\x00zstd', b'\x04\x00\x00\x00zzzz')
    path = tmp_path / 'a.mcap'
    path.write_bytes(data)
    assert len(read_values(path)) == 0
    assert "unknown compression 'zzzz'" in losses(path)


def test_two_files_in_one_are_both_read(tmp_path):
    rows = strain_messages(N)
    path = tmp_path / 'a.mcap'
    for options in ({}, {'use_chunking': False}):
        halves = [mcap_bytes(part, **options) for part in (rows[:70], rows[70:])]
        path.write_bytes(b''.join(halves))
        assert read_values(path) == pytest.approx(np.arange(N))
        # the first without its end, as of a recorder that was started again
        path.write_bytes(halves[0][:-40] + halves[1])
        k = read_values(path)
        assert set(range(70, N)) <= set(np.rint(k).astype(int))


def test_without_footer_and_summary_nothing_is_lost(tmp_path):
    data = mcap_bytes(strain_messages(N))
    end = sum(next(chunks(data)))
    path = tmp_path / 'a.mcap'
    path.write_bytes(data[:end])
    assert read_values(path) == pytest.approx(np.arange(N))
    path.write_bytes(data[:-8])
    assert read_values(path) == pytest.approx(np.arange(N))


def test_a_chunk_that_claims_too_much_is_not_believed(tmp_path):
    data = bytearray(mcap_bytes(strain_messages(N)))
    begin, _ = next(chunks(bytes(data)))
    path = tmp_path / 'a.mcap'
    for size in (1 << 62, 1 << 31, 10):
        struct.pack_into('<Q', data, begin + 9 + 16, size)
        path.write_bytes(data)
        assert len(read_values(path)) == 0
        assert 'its messages are lost' in losses(path)


def test_the_beginning_alone_is_an_empty_recording(tmp_path):
    path = tmp_path / 'a.mcap'
    path.write_bytes(b'\x89MCAP0\r\n')
    assert bagfile.topics(path) == []
    assert len(read_values(path)) == 0


def test_any_damage_ends_in_data_or_one_line(tmp_path):
    """Flip, cut, insert and repeat bytes anywhere; read with everything that reads."""
    rng = np.random.default_rng(3)
    originals = [
        mcap_bytes(strain_messages(30), chunk_size=800, compression=CompressionType.NONE),
        mcap_bytes(strain_messages(30), chunk_size=800),
        mcap_bytes(strain_messages(30), use_chunking=False),
        database(tmp_path / 'whole.db3').read_bytes(),
    ]
    path = tmp_path / 'damaged'
    n_read = 0
    for i in range(400):
        data = bytearray(originals[i % len(originals)])
        for _ in range(rng.integers(1, 4)):
            at = int(rng.integers(0, len(data)))
            n = int(rng.integers(1, 30))
            action = rng.integers(0, 5)
            if action == 0:
                data[at] ^= 1 << int(rng.integers(0, 8))
            elif action == 1:
                data[at : at + n] = rng.bytes(n)
            elif action == 2:
                del data[at : at + n]
            elif action == 3:
                data[at:at] = b'\xff' * n
            else:
                data[at : at + 8] = struct.pack('<Q', int(rng.integers(0, 1 << 62)))
        path.write_bytes(data)
        failure = read_in_every_way(path)
        n_read += not failure
        assert '\n' not in failure
        assert not failure or str(path) in failure
    assert n_read > 200


def read_in_every_way(path: Path) -> str:
    """Return the error's text, '' without."""
    try:
        bagfile.read(path, MACHINE)
        bagfile.topics(path)
        list(bagfile.messages(path))
    except BagError as error:
        return str(error)
    return ''


def database(path: Path, n: int = 30) -> Path:
    """Write a rosbag2 database by hand."""
    with sqlite3.connect(path) as made:
        made.execute(
            'CREATE TABLE topics (id INTEGER PRIMARY KEY, name TEXT, type TEXT, '
            'serialization_format TEXT, offered_qos_profiles TEXT)'
        )
        made.execute(
            'CREATE TABLE messages (id INTEGER PRIMARY KEY, topic_id INTEGER, '
            'timestamp INTEGER, data BLOB)'
        )
        made.execute(
            "INSERT INTO topics VALUES (1, '/measured/link/left_a/strain', "
            "'escalator_msgs/msg/LinkStrain', 'cdr', '')"
        )
        for row in strain_messages(n):
            made.execute(
                'INSERT INTO messages (topic_id, timestamp, data) VALUES (1, ?, ?)',
                (row.bag_ns, row.data),
            )
    made.close()
    return path


def test_a_damaged_database_gives_what_comes_before(tmp_path):
    path = database(tmp_path / 'a.db3', 2000)
    assert read_values(path) == pytest.approx(np.arange(2000))
    data = path.read_bytes()
    path.write_bytes(data[: 2 * len(data) // 3])
    k = read_values(path)
    assert len(k) > 1000
    assert k == pytest.approx(np.arange(len(k)))


def test_messages_in_an_unfinished_log_of_the_database_are_read(tmp_path):
    path = database(tmp_path / 'a.db3')
    writing = sqlite3.connect(path)
    writing.execute('PRAGMA journal_mode=WAL')
    writing.execute('PRAGMA wal_autocheckpoint=0')
    row = strain_messages(31)[-1]
    writing.execute(
        'INSERT INTO messages (topic_id, timestamp, data) VALUES (1, ?, ?)', (row.bag_ns, row.data)
    )
    writing.commit()
    copy = tmp_path / 'copy.db3'
    copy.write_bytes(path.read_bytes())
    copy.with_name('copy.db3-wal').write_bytes(path.with_name('a.db3-wal').read_bytes())
    writing.close()
    assert read_values(copy) == pytest.approx(np.arange(31))


def test_a_bag_survives_one_file_of_several(tmp_path):
    rows = strain_messages(60)
    write_mcap(tmp_path / 'a_0.mcap', rows[:30])
    (tmp_path / 'a_1.mcap').write_bytes(b'nothing')
    assert read_values(tmp_path) == pytest.approx(np.arange(30))
    assert 'a_1.mcap' in losses(tmp_path)
    (tmp_path / 'a_0.mcap').write_bytes(b'')
    with pytest.raises(BagError, match='none of the files'):
        bagfile.read(tmp_path, MACHINE)


@pytest.mark.shared
def test_other_peoples_bags(shared):
    """416 files of the format's own conformance tests, and rosbag2's test bags."""
    n_messages = 0
    n_files = 0
    for path in sorted((shared / 'foreign_bags').rglob('*')):
        if path.suffix not in ('.mcap', '.db3'):
            continue
        n_files += 1
        assert bagfile.read(path, MACHINE).signals == {}
        with Bag(path) as bag:
            n = sum(len(block.bag_ns) for _, block in bag.blocks(None))
            assert sum(info.n_messages for info in topics_of(bag)) == n, path
            assert bag.losses == [], path
        name = path.parent.name
        if name in ('NoData', 'OneAttachment', 'OneMetadata'):
            assert n == 0
        if name in ('OneMessage', 'OneSchemalessMessage'):
            assert n == 1
        if name == 'TenMessages':
            times = [m.bag_ns for m in bagfile.messages(path)]
            assert times == sorted(times) == [0, 1, 2, 3, 3, 4, 5, 7, 8, 9]
        n_messages += n
    assert n_files == 416 + 20 + 19
    assert n_messages > 10_000


def test_the_marker_text_of_a_string_is_not_the_magic(tmp_path):
    made = message('std_msgs/msg/String', data='MCAP0')
    rows = [raw('/s', 'std_msgs/msg/String', START_NS, made), *strain_messages(5)]
    assert STORE.deserialize_cdr(rows[0].data, rows[0].type).data == 'MCAP0'
    assert len(read_values(write_mcap(tmp_path / 'a.mcap', rows, use_chunking=False))) == 5
