"""A recording replayed beside the simulator, each node in a process of its own, over DDS."""

from dataclasses import dataclass
import json
import math
from pathlib import Path
import time
from typing import Any

import numpy as np
import pytest

from escalator_twin import bagfile
from escalator_twin.cli.main import main

from .conftest import PROTOTYPE, SAMPLE
from .programs import program

pytestmark = [pytest.mark.ros, pytest.mark.slow, pytest.mark.issue(2), pytest.mark.issue(5)]

RATES = {1: 45.0, 10: 0.0}  # rate -> what of the 65 s is left out at the start, s
SIMULATED = {
    '/simulated/link/left_a/strain': 'escalator_msgs/msg/LinkStrain',
    '/simulated/link/left_b/strain': 'escalator_msgs/msg/LinkStrain',
    '/simulated/link/right_a/strain': 'escalator_msgs/msg/LinkStrain',
    '/simulated/link/right_b/strain': 'escalator_msgs/msg/LinkStrain',
    '/simulated/step/acceleration': 'sensor_msgs/msg/Imu',
    '/simulated/tensioner/displacement': 'escalator_msgs/msg/TensionerDisplacement',
}


@dataclass
class Replayed:
    """What came of one replay."""

    rate: int
    offset_s: float
    wall_s: float
    heard: dict[str, list[bytes]]
    summary: Any
    folder: Path
    log: str


def expected(offset_s: float) -> dict[str, list[bytes]]:
    """Return what a replay has to publish, by topic."""
    first = min(i.first_ns for i in bagfile.topics(SAMPLE)) + round(offset_s * 1e9)
    messages: dict[str, list[bytes]] = {}
    for message in bagfile.messages(SAMPLE):
        if message.bag_ns >= first or message.topic == '/measured/experiment':
            messages.setdefault(message.topic, []).append(message.data)
    return messages


@pytest.fixture(scope='module', params=list(RATES), ids=lambda rate: f'rate {rate}')
def replayed(request, node, tmp_path_factory):
    """Return what a witness heard of a replay."""
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.qos import DurabilityPolicy, QoSProfile

    from escalator_msgs.msg import Comparison

    from .witness import Witness

    rate, offset = request.param, RATES[request.param]
    folder = tmp_path_factory.mktemp(f'rate_{rate}')
    measured = {info.topic: info.type for info in bagfile.topics(SAMPLE)}
    witness = Witness(node, {**measured, **SIMULATED})
    given = {'machine': PROTOTYPE, 'rate': rate, 'bag': SAMPLE, 'start_offset_s': offset}
    given |= {'json': folder / 'live.json', 'session': folder / 'session'}
    with (
        program('simulator', folder, machine=PROTOTYPE, autostart=False),
        program('comparator', folder, **given) as comparator,
    ):
        comparator.wait_for('replaying')
        start = time.monotonic()
        comparator.wait_for('comparing the whole', timeout=120.0)
        wall = time.monotonic() - start
        comparator.wait_for('compared ')
        # what the transport drops at the end comes again with a heartbeat, seconds later
        witness.wait_for({t: len(m) for t, m in expected(offset).items()})
        witness.wait_until_silent()
        # a late subscriber: the summary is latched
        found: list[Any] = []
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        late = node.create_subscription(Comparison, 'comparator/summary', found.append, latched)
        executor = SingleThreadedExecutor(context=node.context)
        executor.add_node(node)
        limit = time.monotonic() + 20.0
        while not found and time.monotonic() < limit:
            executor.spin_once(timeout_sec=0.1)
        executor.remove_node(node)
        node.destroy_subscription(late)
        assert comparator.interrupt() == 0
        log = comparator.text
    witness.close()
    assert found, log
    return Replayed(rate, offset, wall, witness.heard, found[0], folder, log)


def test_every_measured_message_arrives_once_in_order_unchanged(replayed):
    for topic, messages in expected(replayed.offset_s).items():
        # DDS pads a message to a multiple of four bytes
        padded = [m + b'\0' * (-len(m) % 4) for m in messages]
        heard = set(replayed.heard[topic])
        lost = [k for k, message in enumerate(padded) if message not in heard]
        assert not lost, f'{topic}: {len(lost)} of {len(padded)}, {lost[0]} to {lost[-1]}'
        assert replayed.heard[topic] == padded, topic


def test_every_simulated_sample_arrives_once_in_order(replayed):
    from .witness import stamp_ns

    stamps = {t: np.array([stamp_ns(m) for m in replayed.heard[t]]) for t in SIMULATED}
    ones = next(iter(stamps.values()))
    # from a second before the recording to a second after it
    assert len(ones) > 200 * (65 - replayed.offset_s + 1.9)
    for topic, found in stamps.items():
        assert np.array_equal(np.diff(found), np.full(len(found) - 1, 5_000_000)), topic
        assert np.array_equal(found, ones), topic
    assert ' 0 lost, 0 out of order' in replayed.log


def test_replay_keeps_its_rate(replayed):
    played = 65.0 - replayed.offset_s
    assert replayed.wall_s > 0.95 * played / replayed.rate


@pytest.fixture(scope='module')
def offline(tmp_path_factory):
    """Return what the command line makes of the same recording."""
    file = tmp_path_factory.mktemp('offline') / 'compare.json'
    words = ['compare', str(SAMPLE), '--machine', str(PROTOTYPE), '--json', str(file)]
    assert main(words) == 0
    return json.loads(file.read_text())['recordings'][0]


def same(one: Any, other: Any, where: str = '') -> None:
    """Assert that two JSON values hold the same keys and texts, and numbers equal to 1e-9."""
    if isinstance(one, dict):
        assert set(one) == set(other), where
        for key in one:
            same(one[key], other[key], f'{where}.{key}')
    elif isinstance(one, list):
        assert len(one) == len(other), where
        for i, (a, b) in enumerate(zip(one, other, strict=True)):
            same(a, b, f'{where}[{i}]')
    elif isinstance(one, float | int):
        assert one == pytest.approx(other, rel=1e-9, abs=1e-9), where
    else:
        assert one == other, where


def test_live_equals_offline(replayed, offline):
    live = json.loads((replayed.folder / 'live.json').read_text())['recordings'][0]
    if replayed.offset_s:
        assert live['speed_m_s']['value'] == pytest.approx(offline['speed_m_s']['value'], rel=2e-3)
        return
    same(live, offline)


def test_summary_is_the_document(replayed):
    document = json.loads((replayed.folder / 'live.json').read_text())['recordings'][0]
    summary = replayed.summary
    assert summary.final
    assert summary.recording == str(SAMPLE)
    assert summary.start_s_m == document['start_s_m']
    assert summary.speed_m_s == document['speed_m_s']['value']
    assert [c.channel for c in summary.channels] == list(document['channels'])
    for channel in summary.channels:
        scores = document['channels'][channel.channel]
        for name in ('r_time', 'r_freq', 'nrmse', 'lag_s', 'ripple_r', 'ceiling_r_time'):
            value = getattr(channel, name)
            assert scores[name] == (None if math.isnan(value) else value)
        assert len(channel.orders) == len(scores['orders'])


def test_session_holds_both_sides_and_reads_like_the_recording(replayed, tmp_path):
    session = replayed.folder / 'session'
    counts = {info.topic: info.n_messages for info in bagfile.topics(session)}
    for topic, messages in replayed.heard.items():
        assert counts[topic] == len(messages), topic
    assert counts['/comparator/comparison'] >= 1
    layout = json.loads((replayed.folder / 'session.foxglove.json').read_text())
    for plot in layout['configById'].values():
        for path in plot['paths']:
            assert counts[path['value'].rsplit('.', 1)[0]] > 0
    if not replayed.offset_s:
        file = tmp_path / 'again.json'
        words = ['compare', str(session), '--machine', str(PROTOTYPE), '--json', str(file)]
        assert main(words) == 0
        again = json.loads(file.read_text())['recordings'][0]
        live = json.loads((replayed.folder / 'live.json').read_text())['recordings'][0]
        same({**again, 'path': ''}, {**live, 'path': ''})
