"""Without a bag: loggers are heard, the simulator runs beside them, windows are compared."""

from importlib import import_module
import json
from pathlib import Path
import time

import pytest

from escalator_twin import bagfile
from escalator_twin.cli.main import main

from .conftest import TOY
from .programs import program
from .test_replay import same

pytestmark = [pytest.mark.ros, pytest.mark.slow, pytest.mark.issue(2), pytest.mark.issue(5)]

RATE = 3.0  # of the loggers, for the sake of the test's time


def play(node, path: Path) -> int:
    """Publish a bag as loggers would; return how many messages that were."""
    from rclpy.qos import QoSProfile

    messages = list(bagfile.messages(path))
    publishers = {}
    for message in messages:
        if message.topic not in publishers:
            package, _, name = message.type.split('/')
            kind = getattr(import_module(f'{package}.msg'), name)
            publishers[message.topic] = node.create_publisher(
                kind, message.topic, QoSProfile(depth=1000)
            )
    limit = time.monotonic() + 60.0
    while any(p.get_subscription_count() == 0 for p in publishers.values()):
        assert time.monotonic() < limit, 'nobody listens'
        time.sleep(0.05)
    start = time.monotonic()
    for message in messages:
        due = (message.bag_ns - messages[0].bag_ns) / 1e9 / RATE
        if (ahead := due - (time.monotonic() - start)) > 0.002:
            time.sleep(ahead)
        publishers[message.topic].publish(message.data)
    for publisher in publishers.values():
        publisher.wait_for_all_acked()
        node.destroy_publisher(publisher)
    return len(messages)


def test_heard_loggers_are_compared_as_a_recording_of_them_would_be(node, toy_bag, tmp_path):
    given = {'machine': TOY, 'window_s': 8.0, 'timeout_s': 3.0, 'exit_at_end': True}
    given |= {'json': tmp_path / 'live.json', 'session': tmp_path / 'session'}
    with (
        program('simulator', tmp_path, machine=TOY, autostart=False) as simulator,
        program('comparator', tmp_path, **given) as comparator,
    ):
        comparator.wait_for('listening')
        n_played = play(node, toy_bag)
        assert comparator.wait() == 0, comparator.text
        log = comparator.text
        assert simulator.interrupt() == 0
    assert ' 0 lost, 0 out of order' in log
    # each logger's message is in the session, and windows beside the summary
    session = tmp_path / 'session'
    counts = {info.topic: info.n_messages for info in bagfile.topics(session)}
    assert sum(n for topic, n in counts.items() if topic.startswith('/bench/')) == n_played
    assert counts['/comparator/comparison'] >= 2
    assert counts['/twin/laser'] > 0
    # the same samples give the same numbers without ROS
    file = tmp_path / 'offline.json'
    words = ['compare', str(session), '--machine', str(TOY), '--json', str(file)]
    assert main(words) == 0
    offline = json.loads(file.read_text())['recordings'][0]
    live = json.loads((tmp_path / 'live.json').read_text())['recordings'][0]
    assert live['speed_m_s']['value'] == pytest.approx(0.293, rel=2e-3)
    same({**live, 'path': ''}, {**offline, 'path': ''})
