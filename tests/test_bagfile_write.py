"""Bags that are written: other libraries read them, and nothing half-made is left."""

from dataclasses import replace
from pathlib import Path

from hypothesis import given, settings
from hypothesis import strategies as st
from makers import (
    prototype,
    ROOT,
    START_NS,
    STORE,
    strain_messages,
    synthetic,
    write_mcap,
)
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
import numpy as np
import pytest
from rosbags.rosbag2 import Reader
from rosbags.typesys import get_types_from_msg
import yaml

from escalator_twin import bagfile
from escalator_twin.bagfile.cdr import columns, leaves, walk
from escalator_twin.bagfile.definitions import known_types
from escalator_twin.bagfile.encoding import encode
from escalator_twin.bagfile.own_types import DEFINITIONS
from escalator_twin.errors import BagError
from escalator_twin.signals import Experiment, make_signal, Recording

pytestmark = pytest.mark.issue(2)

MACHINE = prototype()
# Type hashes of ROS 2's own types and of the data sheet's, as the recordings have them.
HASHES = {
    'escalator_msgs/msg/Experiment': 'cbdb752e22ba38fc99956697511e4e02f7993aadbcce969457dfed276b39e313',
    'escalator_msgs/msg/LinkStrain': '6fc748205d045eef6efe2c4ea548347b5cfaa7a1f9c20c396aa05f31046fe467',
    'sensor_msgs/msg/Imu': '7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b',
    'escalator_msgs/msg/TensionerDisplacement': (
        '20c0eab1e9f5bdfca5a75f5fe691eecbf7c65e9ed6a185f1a758d6dd2c65ef65'
    ),
}


@pytest.fixture(scope='module')
def recording():
    return synthetic(MACHINE, 3.0)


@pytest.fixture(scope='module')
def bag(recording, tmp_path_factory):
    path = tmp_path_factory.mktemp('written') / 'bag'
    bagfile.write(path, recording, MACHINE)
    return path


def test_values_come_back(recording, bag):
    again = bagfile.read(bag, MACHINE)
    assert list(again.signals) == list(recording.signals)
    for name, signal in recording.signals.items():
        other = again.signals[name]
        assert np.array_equal(other.stamp_ns, signal.stamp_ns)
        assert np.array_equal(other.bag_ns, signal.bag_ns)
        # scaling to the field and back rounds once each way
        assert other.parts == pytest.approx(signal.parts, rel=4e-16, abs=1e-300)
    assert again.experiment == recording.experiment


def test_metadata_is_rosbag2s_version_9(bag):
    info = yaml.safe_load((bag / 'metadata.yaml').read_text())['rosbag2_bagfile_information']
    assert info['version'] == 9
    assert info['storage_identifier'] == 'mcap'
    assert info['relative_file_paths'] == ['bag.mcap']
    for entry in info['topics_with_message_count']:
        topic = entry['topic_metadata']
        assert topic['serialization_format'] == 'cdr'
        assert topic['offered_qos_profiles'] == []
        assert topic['type_description_hash'] == f'RIHS01_{HASHES[topic["type"]]}'
    assert info['message_count'] == sum(i.n_messages for i in bagfile.topics(bag))


def test_the_mcap_library_decodes_every_message(recording, bag):
    counts: dict[str, int] = {}
    strain = []
    with (bag / 'bag.mcap').open('rb') as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()], validate_crcs=True)
        assert reader.get_header().profile == 'ros2'
        chunks = reader.get_summary().chunk_indexes
        assert {chunk.compression for chunk in chunks} == {'zstd'}
        for schema, channel, _, made in reader.iter_decoded_messages():
            assert schema.encoding == 'ros2msg'
            assert channel.message_encoding == 'cdr'
            counts[channel.topic] = counts.get(channel.topic, 0) + 1
            if channel.topic == '/simulated/link/left_a/strain':
                assert made.link == 'left_a'
                strain.append(list(made.strain))
            elif channel.topic == '/simulated/step/acceleration':
                assert made.orientation_covariance[0] == -1.0
                assert made.angular_velocity_covariance[0] == -1.0
                assert made.orientation.w == 1.0
    assert counts['/simulated/experiment'] == 1
    assert counts['/simulated/link/left_a/strain'] == 600
    assert counts['/simulated/tensioner/displacement'] == 300
    expected = recording.signals['link_force/left_a'].parts / 7.56e7
    assert np.array(strain) == pytest.approx(expected, rel=1e-15)


def test_the_rosbags_library_reads_it_in_order(bag):
    with Reader(bag) as reader:
        times = [time for _, time, _ in reader.messages()]
        assert len(times) == reader.message_count
        assert times == sorted(times)


def test_topics_of_the_recording_may_go_anywhere(recording, tmp_path):
    bagfile.write(tmp_path / 'bag', recording, MACHINE, namespace='/measured')
    assert bagfile.read(tmp_path / 'bag', MACHINE).findings == ()


def test_nothing_is_overwritten(recording, tmp_path):
    (tmp_path / 'bag').mkdir()
    (tmp_path / 'bag' / 'thesis.txt').write_text('years of work')
    with pytest.raises(BagError, match='exists already and is not empty'):
        bagfile.write(tmp_path / 'bag', recording, MACHINE)
    with pytest.raises(BagError, match='exists already'):
        bagfile.write(tmp_path / 'bag' / 'thesis.txt', recording, MACHINE)
    assert [p.name for p in tmp_path.rglob('*')] == ['bag', 'thesis.txt']
    (tmp_path / 'empty').mkdir()
    bagfile.write(tmp_path / 'empty', recording, MACHINE)
    assert (tmp_path / 'empty' / 'metadata.yaml').is_file()


@pytest.mark.parametrize('error', [KeyboardInterrupt, ValueError])
def test_an_interrupted_bag_leaves_nothing(tmp_path, error):
    def interrupted():
        yield from (bagfile.Message(r.topic, r.bag_ns, r.data, r.type) for r in strain_messages(9))
        raise error

    with pytest.raises(error):
        bagfile.write(tmp_path / 'bag', interrupted())
    assert list(tmp_path.iterdir()) == []


def test_a_place_that_cannot_be_written_is_one_line(recording, tmp_path):
    (tmp_path / 'file').write_text('')
    with pytest.raises(BagError, match='cannot be made'):
        bagfile.write(tmp_path / 'file' / 'bag', recording, MACHINE)


def test_messages_are_copied_as_they_are(tmp_path):
    source = write_mcap(tmp_path / 'a.mcap', strain_messages(50))
    bagfile.write(tmp_path / 'copy', bagfile.messages(source))
    assert list(bagfile.messages(tmp_path / 'copy')) == list(bagfile.messages(source))


def test_a_definition_may_be_given_and_must_be_known(tmp_path):
    kind = 'other_msgs/msg/Own'
    store_types = get_types_from_msg('float64 x', kind)
    data = encode(kind, store_types, {('x',): 3.5})
    rows = [bagfile.Message('/own', 5, data, kind)]
    bagfile.write(tmp_path / 'bag', rows, definitions={kind: 'float64 x'})
    (info,) = bagfile.topics(tmp_path / 'bag')
    assert info == ('/own', kind, 1, 5, 5, 'cdr')
    with pytest.raises(BagError, match="no definition of the type 'other_msgs/msg/Own'"):
        bagfile.write(tmp_path / 'other', rows)


# what a recording becomes


def one_topic(*signals):
    """Return a machine whose first two accelerations share a topic, and a recording of them."""
    recording = Recording('', {s.channel: s for s in signals})
    return recording


def acceleration(axis, times, values):
    stamps = START_NS + np.asarray(times) * 5_000_000
    return make_signal(f'step/acceleration/{axis}', 'm/s2', stamps, stamps, values)


def test_channels_of_one_topic_share_messages_by_stamp(tmp_path):
    recording = one_topic(
        acceleration('x', [0, 1, 2], [1.0, 2.0, 3.0]),
        acceleration('z', [1, 2, 3], [4.0, 5.0, 6.0]),
    )
    bagfile.write(tmp_path / 'bag', recording, MACHINE, namespace='/measured')
    (info,) = bagfile.topics(tmp_path / 'bag')
    assert info.n_messages == 4
    again = bagfile.read(tmp_path / 'bag', MACHINE).signals
    assert again['step/acceleration/x'].values.tolist() == [1.0, 2.0, 3.0]
    assert again['step/acceleration/z'].values.tolist() == [4.0, 5.0, 6.0]
    assert again['step/acceleration/z'].stamp_ns[0] == START_NS + 5_000_000


def test_one_value_fills_all_fields(tmp_path):
    stamps = START_NS + np.arange(3) * 5_000_000
    signal = make_signal('link_force/left_a', 'N', stamps, stamps, [10.0, 20.0, 30.0])
    bagfile.write(tmp_path / 'bag', one_topic(signal), MACHINE)
    again = bagfile.read(tmp_path / 'bag', MACHINE).signals['link_force/left_a']
    assert again.parts == pytest.approx(np.array([[10.0] * 4, [20.0] * 4, [30.0] * 4]))


def test_labels_sign_scale_and_offset_are_inverted(tmp_path):
    sensors = tuple(
        replace(s, sign=-1.0, scale=1e-3, offset=0.5, labels={'header.frame_id': 'carriage'})
        if s.channel == 'tensioner/displacement'
        else s
        for s in MACHINE.instruments.sensors
    )
    machine = replace(MACHINE, instruments=replace(MACHINE.instruments, sensors=sensors))
    stamps = START_NS + np.arange(3) * 10_000_000
    signal = make_signal('tensioner/displacement', 'm', stamps, stamps, [0.0, 0.1, 0.5])
    bagfile.write(tmp_path / 'bag', one_topic(signal), machine)
    (first, *_) = bagfile.messages(tmp_path / 'bag')
    made = STORE.deserialize_cdr(first.data, first.type)
    assert made.displacement == pytest.approx(500.0)
    assert made.header.frame_id == 'carriage'
    again = bagfile.read(tmp_path / 'bag', machine).signals['tensioner/displacement']
    assert again.values == pytest.approx([0.0, 0.1, 0.5], abs=1e-15)


def test_forces_of_links_and_rollers_are_written_with_their_labels(tmp_path):
    stamps = START_NS + np.arange(3) * 5_000_000
    recording = one_topic(
        make_signal('link_force_n/left_b', 'N', stamps, stamps, [1.0, 2.0, 3.0]),
        make_signal('roller/axle_30_right', 'N', stamps, stamps, [4.0, 5.0, 6.0]),
    )
    bagfile.write(tmp_path / 'bag', recording, MACHINE)
    with Reader(tmp_path / 'bag') as reader:
        for connection in reader.connections:
            types = get_types_from_msg(connection.msgdef.data, connection.msgtype)
            STORE.register({k: v for k, v in types.items() if k not in STORE.fielddefs})
        found = [STORE.deserialize_cdr(data, c.msgtype) for c, _, data in reader.messages()]
    forces = [m for m in found if hasattr(m, 'force')]
    rollers = [m for m in found if hasattr(m, 'normal_force')]
    assert [(m.link, m.force) for m in forces] == [
        ('left_b', 1.0),
        ('left_b', 2.0),
        ('left_b', 3.0),
    ]
    assert [(m.axle, m.side, m.normal_force) for m in rollers] == [
        (30, 'right', 4.0),
        (30, 'right', 5.0),
        (30, 'right', 6.0),
    ]


def test_times_that_do_not_fit_are_one_line(tmp_path):
    for first, reason in ((-1, 'do not fit a header'), (1 << 62, 'do not fit a header')):
        stamps = np.array([first])
        signal = make_signal('tensioner/displacement', 'm', stamps, [0], [0.0])
        with pytest.raises(BagError, match=reason):
            bagfile.write(tmp_path / 'bag', one_topic(signal), MACHINE)
    signal = make_signal('tensioner/displacement', 'm', [0], [-5], [0.0])
    with pytest.raises(BagError, match='before 1970'):
        bagfile.write(tmp_path / 'bag', one_topic(signal), MACHINE)


FLOATS = st.floats(
    allow_nan=False, allow_infinity=False, width=64, min_value=-1e30, max_value=1e30
)


@settings(max_examples=25, deadline=None)
@given(
    values=st.lists(st.tuples(FLOATS, FLOATS, FLOATS), min_size=1, max_size=20),
    start=st.integers(1, 2 * 10**18),
    # a message more than a minute from all others is taken for one with a broken stamp
    steps=st.lists(st.integers(1, 5 * 10**10), min_size=20, max_size=20),
    case=st.text(max_size=20).filter(lambda t: '\x00' not in t),
    load=st.floats(0.0, 1e6),
)
def test_any_recording_comes_back(tmp_path_factory, values, start, steps, case, load):
    stamps = start % (2**31 * 10**9 - 10**14) + np.cumsum([0, *steps])[: len(values)]
    signals = [
        make_signal(
            f'step/acceleration/{axis}', 'm/s2', stamps, stamps + 7, [v[k] for v in values]
        )
        for k, axis in enumerate('xyz')
    ]
    experiment = Experiment(0.5, -1, (load,), 10.0, case_id=case, machine='m', notes='ü')
    recording = Recording('', {s.channel: s for s in signals}, experiment)
    path = tmp_path_factory.mktemp('any') / 'bag'
    bagfile.write(path, recording, MACHINE)
    again = bagfile.read(path, MACHINE, '/simulated')
    assert again.experiment == experiment
    for signal in signals:
        other = again.signals[signal.channel]
        assert np.array_equal(other.values, signal.values)
        assert np.array_equal(other.stamp_ns, signal.stamp_ns)
        assert np.array_equal(other.bag_ns, signal.bag_ns)


# serialised messages, by the library's serialiser as the plain twin

NUMERIC = {
    'geometry_msgs/msg/WrenchStamped': {('wrench', 'torque', 'y'): 3.25},
    'sensor_msgs/msg/JointState': {('effort', 2): -1.5, ('header', 'frame_id'): 'abc'},
    'sensor_msgs/msg/Imu': {('angular_velocity_covariance', 8): 9.0},
    'std_msgs/msg/Int16MultiArray': {('data', 0): -7, ('layout', 'data_offset'): 4},
    'diagnostic_msgs/msg/DiagnosticArray': {('status', 1, 'level'): 2, ('status', 0, 'name'): 'x'},
    'std_msgs/msg/Empty': {},
    'tf2_msgs/msg/TFMessage': {('transforms', 0, 'transform', 'rotation', 'w'): 0.5},
}


@pytest.mark.parametrize('kind', NUMERIC)
def test_encoded_messages_are_the_librarys(kind):
    values = NUMERIC[kind]
    data = encode(kind, known_types(), values)
    made = STORE.deserialize_cdr(data, kind)
    for path, value in values.items():
        owner = made
        for part in path:
            owner = owner[part] if isinstance(part, int) else getattr(owner, part)
        assert owner == value
    assert bytes(STORE.serialize_cdr(made, kind)) == data
    found = leaves(data, kind, known_types())
    assert {path: found[path] for path in values} == values


def test_columns_are_the_librarys():
    rows = strain_messages(20)
    table = np.stack([np.frombuffer(row.data, np.uint8) for row in rows])
    kind = 'escalator_msgs/msg/LinkStrain'
    paths = [('strain', 3), ('header', 'stamp', 'nanosec')]
    found, is_read = columns(table, kind, known_types(), paths)
    expected = [STORE.deserialize_cdr(row.data, kind) for row in rows]
    assert is_read.all()
    assert found[0].tolist() == [m.strain[3] for m in expected]
    assert found[1].tolist() == [m.header.stamp.nanosec for m in expected]
    layout = walk(rows[0].data, kind, known_types(), {('link',), ('strain', 0)})
    assert layout.texts == {('link',): 'left_a'}


def test_own_definitions_are_those_of_the_message_package():
    folder = ROOT / 'escalator_msgs' / 'msg'
    for name, text in DEFINITIONS.items():
        path: Path = folder / f'{name.split("/")[-1]}.msg'
        given = get_types_from_msg(path.read_text(encoding='utf-8'), name)
        assert given == get_types_from_msg(text, name)
