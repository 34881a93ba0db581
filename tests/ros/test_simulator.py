"""The simulator by itself: services, parameters, clock, markers, diagnostics."""

import subprocess
import sys
import time

import pytest

from .conftest import TOY
from .programs import program

pytestmark = [pytest.mark.ros, pytest.mark.issue(2)]

SETTLE_S = 2.5  # for a service to discover a new client, too: two seconds have been seen


class Client:
    """Calls services and collects messages, spinning the test's node."""

    def __init__(self, node) -> None:
        from rclpy.executors import SingleThreadedExecutor

        self.node = node
        self.executor = SingleThreadedExecutor(context=node.context)
        self.executor.add_node(node)
        self.clients = {}

    def call(self, kind, name, **fields):
        if name not in self.clients:
            self.clients[name] = self.node.create_client(kind, name)
            assert self.clients[name].wait_for_service(60.0), name
            time.sleep(SETTLE_S)
        client = self.clients[name]
        # on a busy machine the first answer may be lost while the client is being discovered
        for _ in range(3):
            future = client.call_async(kind.Request(**fields))
            self.executor.spin_until_future_complete(future, 20.0)
            if future.done():
                break
        assert future.done(), name
        return future.result()

    def wait(self, condition, timeout=60.0):
        limit = time.monotonic() + timeout
        while not condition():
            assert time.monotonic() < limit
            self.executor.spin_once(timeout_sec=0.05)

    def collect(self, kind, topic):
        found = []
        self.node.create_subscription(kind, topic, found.append, 1000)
        return found


@pytest.fixture(scope='module')
def client(node):
    made = Client(node)
    yield made
    made.executor.remove_node(node)


@pytest.fixture(scope='module')
def simulator(tmp_path_factory):
    folder = tmp_path_factory.mktemp('simulator')
    given = {'machine': TOY, 'autostart': False, 'markers': True, 'publish_clock': True}
    with program('simulator', folder, epoch=1000.0, **given) as made:
        yield made
        assert made.interrupt() == 0
        assert 'Traceback' not in made.text


def start(client, **changes):
    from escalator_msgs.srv import StartExperiment

    values = {'set_speed': 0.3, 'direction': 1, 'load_per_step': [1.0], 'preload': 900.0}
    values |= {'start_s': 0.5, 'real_time_factor': -1.0, **changes}
    return client.call(StartExperiment, 'simulator/start_experiment', **values)


@pytest.mark.usefixtures('simulator')
def test_refusals_name_field_value_and_limits(client):
    for changes, text in (
        ({'set_speed': -1.0}, 'speed: expected'),
        ({'direction': 3}, 'direction: expected +1 or -1'),
        ({'load_per_step': [1.0, 2.0]}, 'load_per_step: expected one value or'),
        ({'start_s': 1e4}, 'start_s: expected 0 to'),
        ({'sample_rate': 333.0}, 'sample_rate: expected'),
        ({'duration': -2.0}, 'duration: expected 0 or more'),
    ):
        answer = start(client, **changes)
        assert not answer.accepted
        assert text in answer.message, answer.message


@pytest.mark.usefixtures('simulator')
def test_run_pause_step_reset(client):
    from geometry_msgs.msg import PointStamped
    from rosgraph_msgs.msg import Clock
    from std_srvs.srv import SetBool, Trigger

    from escalator_msgs.msg import LoopPosition
    from escalator_msgs.srv import Step

    laser = client.collect(PointStamped, '/twin/laser')
    places = client.collect(LoopPosition, '/twin/loop_position')
    clock = client.collect(Clock, '/clock')
    answer = start(client, duration=2.0)
    assert answer.accepted, answer.message
    client.wait(lambda: len(places) == answer.samples)
    # 50 Hz for two seconds from the epoch, at the instrument's own rate
    assert [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in laser] == [
        1_000_000_000_000 + 20_000_000 * k for k in range(100)
    ]
    assert places[0].s == pytest.approx(0.5, abs=1e-3)
    client.wait(lambda: clock and clock[-1].clock.sec == 1001)

    laser.clear()
    assert client.call(Trigger, 'simulator/reset').success
    client.wait(lambda: len(laser) == 100)
    assert laser[0].header.stamp.sec == 1000

    step = client.call(Step, 'simulator/step', duration=0.1)
    assert not step.accepted
    assert 'running' in step.message or 'ended' in step.message
    assert start(client, real_time_factor=0.001).accepted
    assert client.call(SetBool, 'simulator/pause', data=True).success
    first = client.call(Step, 'simulator/step', steps=7)
    second = client.call(Step, 'simulator/step', duration=0.5)
    assert first.accepted
    assert second.accepted
    passed = second.stamp.sec * 10**9 + second.stamp.nanosec
    passed -= first.stamp.sec * 10**9 + first.stamp.nanosec
    assert passed == 500_000_000


@pytest.mark.usefixtures('simulator')
def test_diagnostics_and_markers_while_it_runs(client):
    from diagnostic_msgs.msg import DiagnosticArray
    from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
    from rcl_interfaces.srv import DescribeParameters, ListParameters, SetParameters
    from visualization_msgs.msg import MarkerArray

    status = client.collect(DiagnosticArray, '/diagnostics')
    markers = client.collect(MarkerArray, '/twin/markers')

    def set_pace(value):
        number = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=value)
        wanted = [Parameter(name='real_time_factor', value=number)]
        return client.call(SetParameters, '/simulator/set_parameters', parameters=wanted).results[
            0
        ]

    assert start(client, real_time_factor=0.0).accepted
    assert set_pace(2.0).successful
    refused = set_pace(-3.0)
    assert not refused.successful

    def achieved():
        values = {v.key: v.value for m in status[-1:] for v in m.status[0].values}
        return float(values.get('real-time factor achieved', 'nan'))

    client.wait(lambda: abs(achieved() - 2.0) < 0.1)
    client.wait(lambda: len(markers) > 3)
    shown = {m.ns: m for m in markers[-1].markers}
    assert set(shown) == {'links', 'steps', 'carriage'}
    n_links = 12
    assert len(shown['links'].points) == 2 * 2 * n_links
    assert len(shown['steps'].points) == 6 * n_links
    for marker in (shown['links'], shown['steps']):
        assert {round(abs(p.y), 6) for p in marker.points} == {abs(marker.points[0].y)}

    names = client.call(ListParameters, '/simulator/list_parameters').result.names
    own = [n for n in names if not n.startswith(('use_sim_time', 'qos_', 'start_type', '_'))]
    described = client.call(DescribeParameters, '/simulator/describe_parameters', names=own)
    for descriptor in described.descriptors:
        assert descriptor.description, descriptor.name
        assert descriptor.read_only == (
            descriptor.name not in ('machine', 'message_rate', 'real_time_factor')
        ), descriptor.name


@pytest.mark.parametrize(
    ('node_name', 'words', 'text'),
    [
        ('simulator', ['real_time_factor:=-1.0'], 'real_time_factor: expected 0 to 1000'),
        ('simulator', ['machine:=nowhere.yaml'], 'nowhere.yaml: cannot be read'),
        ('comparator', ['bag:=nowhere'], 'nowhere: no such file'),
        ('comparator', ['rate:=fast'], "rate: expected a number, found 'fast'"),
        ('comparator', ['json:=/nowhere/a.json'], 'json: /nowhere/a.json: cannot be written'),
    ],
)
def test_wrong_parameters_end_in_one_line(node_name, words, text):
    options = [item for word in words for item in ('-p', word)]
    ended = subprocess.run(
        [sys.executable, '-m', f'escalator_twin.ros.{node_name}_node', '--ros-args', *options],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert ended.returncode == 2
    assert ended.stderr.count('\n') == 1, ended.stderr
    assert text in ended.stderr


def test_interrupted_replay_ends_cleanly_and_closes_its_session(toy_bag, tmp_path):
    from escalator_twin import bagfile

    session = tmp_path / 'session'
    with (
        program('simulator', tmp_path, machine=TOY, autostart=False) as simulator,
        program('comparator', tmp_path, machine=TOY, bag=toy_bag, session=session) as comparator,
    ):
        comparator.wait_for('replaying')
        time.sleep(1.5)
        assert comparator.interrupt() == 0
        assert simulator.interrupt() == 0
        for text in (comparator.text, simulator.text):
            assert 'Traceback' not in text
            assert 'ERROR' not in text
    counts = {info.topic: info.n_messages for info in bagfile.topics(session)}
    assert counts['/bench/laser'] > 10
    assert counts['/twin/laser'] > 10
