"""Bags with values that are none, topics that are not there, experiments that cannot be."""

from makers import (
    kinds,
    message,
    prototype,
    raw,
    START_NS,
    STORE,
    strain_messages,
    write_mcap,
)
import numpy as np
import pytest

from escalator_twin import bagfile
from escalator_twin.errors import RecordingError

pytestmark = pytest.mark.issue(2)

MACHINE = prototype()
LEFT_A = 'link_force/left_a'


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
