"""The order and the clocks of the messages in a bag."""

from makers import (
    kinds,
    prototype,
    raw,
    stamp,
    START_NS,
    STORE,
    strain_messages,
    write_mcap,
)
import numpy as np
import pytest

from escalator_twin import bagfile

pytestmark = pytest.mark.issue(2)

MACHINE = prototype()
LEFT_A = 'link_force/left_a'
EA = 7.56e7


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
