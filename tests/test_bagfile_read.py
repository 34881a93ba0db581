"""Bags read as they are: values, units, order, and what is missing."""

from pathlib import Path
import sqlite3

from makers import (
    DISPLACEMENT,
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
from escalator_twin.errors import BagError, RecordingError

pytestmark = pytest.mark.issue(2)

MACHINE = prototype()
LEFT_A = 'link_force/left_a'
EA = 7.56e7


def kinds(recording):
    return {(f.kind, f.channel) for f in recording.findings if f.kind != 'missing_topic'}


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


# order


def test_messages_out_of_order_are_sorted(tmp_path):
    rows = strain_messages(60)
    rows[20], rows[21] = (
        rows[21]._replace(bag_ns=rows[20].bag_ns),
        rows[20]._replace(bag_ns=rows[21].bag_ns),
    )
    recording = bagfile.read(write_mcap(tmp_path / 'a.mcap', rows), MACHINE)
    signal = recording.signals[LEFT_A]
    assert (np.diff(signal.stamp_ns) > 0).all()
    assert signal.values == pytest.approx(EA * 1e-6 * (np.arange(60) + 1.5))
    assert kinds(recording) == {('out_of_order', LEFT_A)}


def test_duplicates_are_dropped(tmp_path):
    rows = strain_messages(60)
    rows = sorted([*rows, rows[10], rows[11]], key=lambda row: row.bag_ns)
    recording = bagfile.read(write_mcap(tmp_path / 'a.mcap', rows), MACHINE)
    assert len(recording.signals[LEFT_A].values) == 60
    (finding,) = [f for f in recording.findings if f.kind == 'duplicate']
    assert finding.detail.startswith('2 messages')
    assert finding.repaired


def test_zero_stamps_give_way_to_the_bag_time(tmp_path):
    rows = [
        raw(row.topic, row.type, row.bag_ns, stamp(STORE.deserialize_cdr(row.data, row.type), 0))
        for row in strain_messages(60)
    ]
    recording = bagfile.read(write_mcap(tmp_path / 'a.mcap', rows), MACHINE)
    signal = recording.signals[LEFT_A]
    assert np.array_equal(signal.stamp_ns, signal.bag_ns)
    assert kinds(recording) == {('clock_disagreement', LEFT_A)}


def test_stamps_far_from_all_others_are_dropped(tmp_path):
    rows = strain_messages(400)
    for i, far_s in ((17, 3 * 10**8), (200, -(10**6)), (399, 2 * 10**8)):
        made = STORE.deserialize_cdr(rows[i].data, rows[i].type)
        stamp(made, START_NS + far_s * 10**9)
        rows[i] = raw(rows[i].topic, rows[i].type, rows[i].bag_ns, made)
    recording = bagfile.read(write_mcap(tmp_path / 'a.mcap', rows), MACHINE)
    assert len(recording.signals[LEFT_A].values) == 397
    assert np.ptp(recording.signals[LEFT_A].stamp_ns) < 3e9
    assert ('clock_disagreement', LEFT_A) in kinds(recording)


@pytest.mark.parametrize('step_s', [-3600, -2, 5, 86400])
def test_a_step_of_the_loggers_clock_is_undone(tmp_path, step_s):
    rows = strain_messages(400)
    for i in range(150, 400):
        made = STORE.deserialize_cdr(rows[i].data, rows[i].type)
        stamp(made, START_NS + 5_000_000 * i + step_s * 10**9)
        rows[i] = raw(rows[i].topic, rows[i].type, rows[i].bag_ns, made)
    recording = bagfile.read(write_mcap(tmp_path / 'a.mcap', rows), MACHINE)
    signal = recording.signals[LEFT_A]
    assert signal.stamp_ns.tolist() == (START_NS + 5_000_000 * np.arange(400)).tolist()
    assert signal.values == pytest.approx(EA * 1e-6 * (np.arange(400) + 1.5))
    assert ('clock_disagreement', LEFT_A) in kinds(recording)


def test_a_stall_of_the_recorder_is_no_step(tmp_path):
    rows = strain_messages(600)
    stalled = rows[300].bag_ns
    rows = rows[:100] + [
        row._replace(bag_ns=max(row.bag_ns, stalled + i * 1000))
        for i, row in enumerate(rows[100:])
    ]
    recording = bagfile.read(write_mcap(tmp_path / 'a.mcap', rows), MACHINE)
    assert kinds(recording) == set()
    assert (
        recording.signals[LEFT_A].stamp_ns.tolist()
        == (START_NS + 5_000_000 * np.arange(600)).tolist()
    )


# values that are none, topics that are not there


def test_samples_that_are_no_numbers_are_dropped(tmp_path):
    rows = strain_messages(60)
    made = STORE.deserialize_cdr(rows[7].data, rows[7].type)
    made.strain = np.where(np.arange(4) == 2, np.nan, made.strain)
    rows[7] = raw(rows[7].topic, rows[7].type, rows[7].bag_ns, made)
    recording = bagfile.read(write_mcap(tmp_path / 'a.mcap', rows), MACHINE)
    assert len(recording.signals[LEFT_A].values) == 59
    assert np.isfinite(recording.signals[LEFT_A].parts).all()
    assert kinds(recording) == {('data_gap', LEFT_A)}


def test_a_gauge_that_is_no_number_is_dead_and_the_others_stay(tmp_path):
    rows = []
    for row in strain_messages(60):
        made = STORE.deserialize_cdr(row.data, row.type)
        made.strain = np.where(np.arange(4) == 1, np.inf, made.strain)
        rows.append(raw(row.topic, row.type, row.bag_ns, made))
    recording = bagfile.read(write_mcap(tmp_path / 'a.mcap', rows), MACHINE)
    parts = recording.signals[LEFT_A].parts
    assert len(parts) == 60
    assert (parts[:, 1] == 0.0).all()
    assert kinds(recording) == {('gauge_dead', LEFT_A)}


def test_missing_topics_are_findings_and_required_ones_an_error(tmp_path):
    path = write_mcap(tmp_path / 'a.mcap', strain_messages(20))
    recording = bagfile.read(path, MACHINE)
    missing = {f.channel for f in recording.findings if f.kind == 'missing_topic'}
    assert missing == {s.channel for s in MACHINE.instruments.sensors} - {LEFT_A}
    bagfile.require(recording, [LEFT_A], MACHINE)
    with pytest.raises(RecordingError, match=r'tensioner/displacement.*/measured/tensioner'):
        bagfile.require(recording, [LEFT_A, 'tensioner/displacement'], MACHINE)


def test_another_encoding_is_a_missing_topic(tmp_path):
    path = write_mcap(tmp_path / 'a.mcap', strain_messages(20), message_encoding='json')
    recording = bagfile.read(path, MACHINE)
    assert not recording.signals
    assert any("'json'" in f.detail for f in recording.findings)


def test_messages_that_do_not_fit_their_type_are_left_out(tmp_path):
    rows = strain_messages(20)
    rows[3] = rows[3]._replace(data=rows[3].data[:30])
    rows[4] = rows[4]._replace(data=b'')
    rows[5] = rows[5]._replace(data=b'\x07\x07\x07\x07' + rows[5].data[4:])
    recording = bagfile.read(write_mcap(tmp_path / 'a.mcap', rows), MACHINE)
    assert len(recording.signals[LEFT_A].values) == 17
    assert any('3 messages do not fit' in f.detail for f in recording.findings)


def test_the_wrong_type_names_the_missing_field(tmp_path):
    made = message('escalator_msgs/msg/TensionerDisplacement', displacement=1.0)
    rows = [
        raw(
            '/measured/link/left_a/strain',
            'escalator_msgs/msg/TensionerDisplacement',
            START_NS,
            made,
        )
    ]
    recording = bagfile.read(write_mcap(tmp_path / 'a.mcap', rows), MACHINE)
    assert any("has no field 'strain'" in f.detail for f in recording.findings)


def test_simulated_topics_stand_in_and_it_is_said(tmp_path):
    rows = strain_messages(20, topic='/simulated/link/left_a/strain')
    path = write_mcap(tmp_path / 'a.mcap', rows)
    recording = bagfile.read(path, MACHINE)
    assert len(recording.signals[LEFT_A].values) == 20
    assert '/simulated' in recording.findings[0].detail
    explicit = bagfile.read(path, MACHINE, namespace='/simulated')
    assert len(explicit.signals[LEFT_A].values) == 20
    assert not bagfile.read(path, MACHINE, namespace='/measured').signals


def experiment_message(**changes):
    values = {'set_speed': 0.25, 'direction': -1, 'load_per_step': 75.0, 'preload': 6000.0}
    made = message(
        'escalator_msgs/msg/Experiment', case_id='case_7', machine='m', **{**values, **changes}
    )
    return raw('/measured/experiment', 'escalator_msgs/msg/Experiment', START_NS, made)


def test_the_experiment_is_read(tmp_path):
    path = write_mcap(tmp_path / 'a.mcap', [experiment_message(), *strain_messages(5)])
    experiment = bagfile.read(path, MACHINE).experiment
    assert experiment.set_speed_m_s == 0.25
    assert experiment.direction == -1
    assert experiment.load_per_step_kg == (75.0,)
    assert experiment.preload_n == 6000.0
    assert (experiment.case_id, experiment.machine) == ('case_7', 'm')


def test_an_impossible_experiment_is_a_finding(tmp_path):
    path = write_mcap(tmp_path / 'a.mcap', [experiment_message(set_speed=-1.0)])
    recording = bagfile.read(path, MACHINE)
    assert recording.experiment is None
    assert any('speed: expected' in f.detail for f in recording.findings)


def test_unrelated_topics_are_not_unpacked(tmp_path, monkeypatch):
    rows = strain_messages(20)
    big = [
        raw(
            '/camera',
            'std_msgs/msg/String',
            START_NS + i,
            message('std_msgs/msg/String', data='x' * 5000),
        )
        for i in range(40)
    ]
    path = write_mcap(tmp_path / 'a.mcap', [*rows, *big], chunk_size=4000)
    from escalator_twin.bagfile import mcapfile

    unpacked = []
    original = mcapfile.decompress

    def counting(data, compression, size):
        unpacked.append(size)
        return original(data, compression, size)

    monkeypatch.setattr(mcapfile, 'decompress', counting)
    assert len(bagfile.read(path, MACHINE).signals[LEFT_A].values) == 20
    assert len(unpacked) <= 4


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
