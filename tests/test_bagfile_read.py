"""Bags read as they are: values, units, layouts, and what is no bag."""

from pathlib import Path
import sqlite3

from makers import (
    DISPLACEMENT,
    kinds,
    mcap_bytes,
    message,
    prototype,
    raw,
    stamp,
    START_NS,
    STORE,
    strain_messages,
    write_mcap,
)
from mcap.writer import CompressionType
import numpy as np
import pytest
from rosbags.rosbag2 import CompressionFormat, CompressionMode, Reader, StoragePlugin, Writer
from rosbags.typesys import get_types_from_msg, get_typestore, Stores

from escalator_twin import bagfile
from escalator_twin.errors import BagError

pytestmark = pytest.mark.issue(2)

MACHINE = prototype()
LEFT_A = 'link_force/left_a'
EA = 7.56e7


def test_values_are_in_si_and_the_mean_of_the_parts(tmp_path):
    path = write_mcap(tmp_path / 'a.mcap', strain_messages(50))
    signal = bagfile.read(path, MACHINE).signals[LEFT_A]
    k = np.arange(50)
    assert signal.parts == pytest.approx(EA * 1e-6 * (k[:, None] + np.arange(4)), rel=1e-12)
    assert signal.values == pytest.approx(EA * 1e-6 * (k + 1.5), rel=1e-12)
    assert signal.stamp_ns.tolist() == (START_NS + 5_000_000 * k).tolist()
    assert signal.bag_ns.tolist() == (START_NS + 5_000_000 * k + 4_000_000).tolist()
    assert signal.unit == 'N'


@pytest.mark.shared
def test_reads_what_the_library_reads(shared):
    path = shared / 'measured' / 'seeded' / 'clean_1'
    recording = bagfile.read(path, MACHINE)
    store = get_typestore(Stores.ROS2_JAZZY)
    expected: dict[str, list[tuple[int, int, list[float]]]] = {}
    with Reader(path) as reader:
        for connection in reader.connections:
            types = get_types_from_msg(connection.msgdef.data, connection.msgtype)
            store.register({k: v for k, v in types.items() if k not in store.fielddefs})
        for connection, bag_ns, data in reader.messages():
            made = store.deserialize_cdr(data, connection.msgtype)
            own = made.header.stamp.sec * 10**9 + made.header.stamp.nanosec
            if hasattr(made, 'strain'):
                values = list(made.strain)
            elif hasattr(made, 'displacement'):
                values = [made.displacement]
            elif hasattr(made, 'linear_acceleration'):
                values = [made.linear_acceleration.z]
            else:
                assert recording.experiment.preload_n == made.preload
                continue
            expected.setdefault(connection.topic, []).append((own, bag_ns, values))
    checked = 0
    for sensor in MACHINE.instruments.sensors:
        if sensor.name in ('acceleration/x', 'acceleration/y'):
            continue
        rows = expected[f'/measured/{sensor.topic}']
        signal = recording.signals[sensor.channel]
        assert signal.stamp_ns.tolist() == [row[0] for row in rows]
        assert signal.bag_ns.tolist() == [row[1] for row in rows]
        assert np.array_equal(signal.parts, sensor.scale * np.array([row[2] for row in rows]))
        checked += 1
    assert checked == 6
    assert recording.findings == ()


@pytest.mark.parametrize(
    'options',
    [
        {'compression': CompressionType.NONE},
        {'compression': CompressionType.LZ4},
        {'compression': CompressionType.ZSTD},
        {'chunk_size': 700},
        {'use_chunking': False},
        {'use_chunking': False, 'use_statistics': False, 'use_summary_offsets': False},
        {'repeat_schemas': False, 'repeat_channels': False},
        {'chunk_size': 700, 'index_types': 0},
        {'enable_crcs': False},
    ],
    ids=str,
)
def test_every_layout_of_mcap_gives_the_same(tmp_path, options):
    if 'index_types' in options:
        from mcap.writer import IndexType

        options = {**options, 'index_types': IndexType.NONE}
    path = write_mcap(tmp_path / 'a.mcap', strain_messages(200), **options)
    recording = bagfile.read(path, MACHINE)
    assert recording.signals[LEFT_A].values[:3] == pytest.approx(
        EA * np.array([1.5e-6, 2.5e-6, 3.5e-6])
    )
    assert len(recording.signals[LEFT_A].values) == 200
    info = {i.topic: i for i in bagfile.topics(path)}['/measured/link/left_a/strain']
    assert info.n_messages == 200
    assert info.first_ns == START_NS + 4_000_000
    assert info.last_ns == START_NS + 4_000_000 + 199 * 5_000_000


@pytest.mark.parametrize('compression', [None, CompressionMode.FILE, CompressionMode.MESSAGE])
@pytest.mark.parametrize('plugin', list(StoragePlugin))
def test_rosbag2_directories_of_both_storages(tmp_path, plugin, compression):
    writer = Writer(tmp_path / 'bag', version=8, storage_plugin=plugin)
    if compression:
        writer.set_compression(compression, CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection(
            '/measured/link/left_a/strain', 'escalator_msgs/msg/LinkStrain', typestore=STORE
        )
        for item in strain_messages(40):
            writer.write(connection, item.bag_ns, item.data)
    signal = bagfile.read(tmp_path / 'bag', MACHINE).signals[LEFT_A]
    assert signal.values == pytest.approx(EA * 1e-6 * (np.arange(40) + 1.5))
    (tmp_path / 'bag' / 'metadata.yaml').unlink()
    if compression != CompressionMode.MESSAGE:
        again = bagfile.read(tmp_path / 'bag', MACHINE).signals[LEFT_A]
        assert np.array_equal(again.values, signal.values)


@pytest.mark.parametrize('with_metadata', [True, False])
def test_split_bags_are_one_recording(tmp_path, with_metadata):
    rows = strain_messages(110)
    names = [f'bag_{i}.mcap' for i in range(11)]
    for i, name in enumerate(names):
        write_mcap(tmp_path / name, rows[10 * i : 10 * i + 10])
    if with_metadata:
        text = 'rosbag2_bagfile_information:\n  version: 5\n  relative_file_paths:\n'
        text += ''.join(f'  - {name}\n' for name in names)
        (tmp_path / 'metadata.yaml').write_text(text)
    recording = bagfile.read(tmp_path, MACHINE)
    assert recording.signals[LEFT_A].values == pytest.approx(EA * 1e-6 * (np.arange(110) + 1.5))
    assert kinds(recording) == set()


def test_a_listed_file_that_is_missing_is_a_gap(tmp_path):
    write_mcap(tmp_path / 'a_0.mcap', strain_messages(20))
    (tmp_path / 'metadata.yaml').write_text(
        'rosbag2_bagfile_information: {relative_file_paths: [a_0.mcap, a_1.mcap]}'
    )
    recording = bagfile.read(tmp_path, MACHINE)
    assert ('data_gap', '') in kinds(recording)
    assert any('a_1.mcap' in f.detail for f in recording.findings)


@pytest.mark.parametrize(
    'text', ['[', 'rosbag2_bagfile_information: 3', '- a', '{relative_file_paths: 7}', '\x00', '']
)
def test_broken_metadata_does_not_hide_the_data(tmp_path, text):
    write_mcap(tmp_path / 'a_0.mcap', strain_messages(20))
    (tmp_path / 'metadata.yaml').write_text(text)
    assert len(bagfile.read(tmp_path, MACHINE).signals[LEFT_A].values) == 20


@pytest.mark.parametrize(
    ('encoding', 'text'), [('', ''), ('ros2msg', 'this is no definition'), ('jsonschema', '{}')]
)
def test_known_types_stand_in_for_an_unusable_schema(tmp_path, encoding, text):
    path = write_mcap(tmp_path / 'a.mcap', strain_messages(20), encoding=encoding, text=text)
    assert len(bagfile.read(path, MACHINE).signals[LEFT_A].values) == 20


def test_big_endian_messages(tmp_path):
    rows = []
    for item in strain_messages(20):
        made = STORE.deserialize_cdr(item.data, item.type)
        data = bytes(STORE.serialize_cdr(made, item.type, little_endian=False))
        rows.append(item._replace(data=data))
    path = write_mcap(tmp_path / 'a.mcap', rows)
    signal = bagfile.read(path, MACHINE).signals[LEFT_A]
    assert signal.values == pytest.approx(EA * 1e-6 * (np.arange(20) + 1.5))


def test_layouts_that_change_from_message_to_message(tmp_path):
    rows = []
    for k in range(600):
        made = message(
            'escalator_msgs/msg/LinkStrain',
            link='x' * (k % 7),
            strain=np.full(4, float(k)),
            header__frame_id='y' * (k % 300),
        )
        time = START_NS + 5_000_000 * k
        rows.append(
            raw(
                '/measured/link/left_a/strain',
                'escalator_msgs/msg/LinkStrain',
                time,
                stamp(made, time),
            )
        )
    path = write_mcap(tmp_path / 'a.mcap', rows)
    signal = bagfile.read(path, MACHINE).signals[LEFT_A]
    assert signal.values == pytest.approx(EA * np.arange(600.0))


# what is no bag


def test_what_is_no_bag_is_one_line(tmp_path):
    (tmp_path / 'empty.mcap').write_bytes(b'')
    (tmp_path / 'text.mcap').write_text('hello')
    (tmp_path / 'ros1.bag').write_bytes(b'#ROSBAG V2.0\n' + b'\x00' * 100)
    (tmp_path / 'folder').mkdir()
    for name, reason in {
        'empty.mcap': 'empty file',
        'text.mcap': 'neither MCAP nor SQLite3',
        'ros1.bag': 'ROS 1',
        'folder': 'no bag in this directory',
        'nowhere': 'no such file',
    }.items():
        with pytest.raises(BagError, match=reason) as caught:
            bagfile.read(tmp_path / name, MACHINE)
        assert name in str(caught.value)
        assert '\n' not in str(caught.value)


def test_a_database_without_the_tables_is_one_line(tmp_path):
    path = tmp_path / 'a.db3'
    with sqlite3.connect(path) as database:
        database.execute('CREATE TABLE x (y)')
    database.close()
    with pytest.raises(BagError, match='not a rosbag2 database'):
        bagfile.read(path, MACHINE)


def test_a_schema_that_contains_itself_ends(tmp_path):
    text = 'escalator_msgs/LinkStrain again\nfloat64[4] strain\n'
    path = write_mcap(tmp_path / 'a.mcap', strain_messages(5), text=text)
    assert len(bagfile.read(path, MACHINE).signals[LEFT_A].values) == 5  # by the known type
    text = 'LinkStrain again\nfloat64[4] strain\n'
    rows = [row._replace(type='other_msgs/msg/LinkStrain') for row in strain_messages(5)]
    recording = bagfile.read(write_mcap(tmp_path / 'b.mcap', rows, text=text), MACHINE)
    assert not recording.signals
    assert any('fits its type' in f.detail for f in recording.findings)


# messages in order


def test_messages_come_in_bag_time_over_chunks_and_files(tmp_path):
    rows = strain_messages(300)
    rng = np.random.default_rng(1)
    shuffled = [rows[i] for i in rng.permutation(300)]
    write_mcap(tmp_path / 'a_0.mcap', shuffled[:150], chunk_size=900)
    write_mcap(tmp_path / 'a_1.mcap', shuffled[150:], use_chunking=False)
    found = list(bagfile.messages(tmp_path))
    assert [m.bag_ns for m in found] == [row.bag_ns for row in rows]
    assert [m.data for m in found] == [row.data for row in rows]
    assert {m.type for m in found} == {'escalator_msgs/msg/LinkStrain'}
    assert list(bagfile.messages(tmp_path, ['/other'])) == []


def test_definition_text_of_the_maker_is_the_projects():
    assert DISPLACEMENT in mcap_bytes(
        [
            raw(
                '/t',
                'escalator_msgs/msg/TensionerDisplacement',
                1,
                message('escalator_msgs/msg/TensionerDisplacement'),
            )
        ],
        compression=CompressionType.NONE,
    ).decode('utf-8', 'replace')


def test_paths_may_be_text(tmp_path: Path):
    path = write_mcap(tmp_path / 'a.mcap', strain_messages(2))
    assert bagfile.read(str(path), MACHINE).path == str(path)
