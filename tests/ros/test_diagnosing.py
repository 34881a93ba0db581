"""The comparator diagnoses when asked, over DDS; the simulator takes the extended machine over."""

import json
import math
import time

import pytest

from escalator_twin.cli.main import main
from escalator_twin.machine import load_machine

from .conftest import PROTOTYPE, TOY
from .programs import Program, program
from .stand_in import diagnose
from .test_replay import same
from .test_simulator import Client, SETTLE_S

pytestmark = [pytest.mark.ros, pytest.mark.issue(7)]

REFUSING, DYING, ENDLESS = 2, 3, 4  # seeds of the stand-in


class Asker(Client):
    """A client of the action, too."""

    def connect(self) -> None:
        from rclpy.action import ActionClient

        from escalator_msgs.action import Diagnose

        self.action = ActionClient(self.node, Diagnose, 'comparator/diagnose')
        limit = time.monotonic() + 60.0
        while not self.action.server_is_ready():
            assert time.monotonic() < limit
            self.executor.spin_once(timeout_sec=0.05)
        time.sleep(SETTLE_S)

    def wait_for(self, future, timeout=120.0):
        self.executor.spin_until_future_complete(future, timeout)
        assert future.done()
        return future.result()

    def send(self, told=None, **fields):
        """Return a goal's handle; ``told`` gets the feedback."""
        from escalator_msgs.action import Diagnose

        def note(message):
            if told is not None:
                told.append(message.feedback)

        return self.wait_for(self.action.send_goal_async(Diagnose.Goal(**fields), note))

    def ask(self, told=None, timeout=120.0, **fields):
        """Return a goal's status and result."""
        handle = self.send(told, **fields)
        assert handle.accepted
        answer = self.wait_for(handle.get_result_async(), timeout)
        return answer.status, answer.result


@pytest.fixture(scope='module')
def asker(node):
    made = Asker(node)
    yield made
    made.executor.remove_node(node)


@pytest.fixture(scope='module')
def nodes(asker, toy_bag, tmp_path_factory):
    """Return the comparator, which has replayed the toy's bag beside the simulator, and a folder."""
    folder = tmp_path_factory.mktemp('diagnosing')
    given = {'machine': TOY, 'bag': toy_bag, 'rate': 0.0, 'json': folder / 'live.json'}
    given |= {'session': folder / 'session'}
    with (
        program('simulator', folder, machine=TOY, autostart=False) as simulator,
        program('ros.stand_in', folder, **given) as comparator,
    ):
        comparator.wait_for('compared ')
        asker.connect()
        yield comparator, folder
        assert comparator.interrupt() == 0
        assert simulator.interrupt() == 0
        for text in (comparator.text, simulator.text):
            assert 'Traceback' not in text, text


def test_goal_gives_feedback_and_the_result_of_the_same_call_offline(
    asker, nodes, toy_bag, tmp_path
):
    from action_msgs.msg import GoalStatus

    _, folder = nodes
    told = []
    status, result = asker.ask(told, seed=1, jobs=2)
    assert (status, result.success) == (GoalStatus.STATUS_SUCCEEDED, True)
    assert [t.fraction for t in told] == [0.0, 0.0, 0.25, 0.5, 0.75]
    assert told[-1].stage == '75% is diagnosed'
    extended = folder / 'live_extended.yaml'
    assert result.extended_machine == str(extended)
    assert load_machine(extended).deviations[0].cause == 'tensioner_stiffness'
    assert 'tensioner_stiffness: factor 0.5 (0.4 to 0.6); p 0.90' in result.message
    offline = diagnose([str(toy_bag)], str(TOY), 1, 2, lambda *_: None, tmp_path / 'offline.yaml')
    offline['extended_machine'] = str(extended)
    same(json.loads(result.json), json.loads(json.dumps(offline)))


@pytest.mark.usefixtures('nodes')
def test_findings_are_published_for_who_comes_later(asker):
    from rclpy.qos import DurabilityPolicy, QoSProfile

    from escalator_msgs.msg import Diagnosis

    asker.ask(seed=1)
    found = []
    latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
    asker.node.create_subscription(Diagnosis, 'comparator/diagnosis', found.append, latched)
    asker.wait(lambda: found)
    message = found[0]
    assert message.header.stamp.sec > 0
    stiffness, gain = message.effects
    assert (stiffness.cause, stiffness.probability) == ('tensioner_stiffness', 0.9)
    assert stiffness.alternatives == ['chain_elongation']
    (factor,) = stiffness.parameters
    assert (factor.name, factor.value, factor.low, factor.high) == ('factor', 0.5, 0.4, 0.6)
    place = stiffness.location
    assert (place.link, place.axle, place.step, place.side) == (-1, -1, -1, '')
    assert math.isnan(place.s_m)
    # a measurement's link has a name, not a number
    assert (gain.location.link, gain.location.instrument) == (-1, 'left_a')
    (candidate,) = message.candidates
    assert (candidate.location.axle, candidate.location.side) == (4, 'left')
    rest = message.unexplained
    assert (rest.significant, rest.share, rest.locked_to) == (True, 0.2, 'travel')
    assert (rest.channels, rest.s_m, rest.link) == (['chain/pull'], 0.7, -1)
    assert (rest.frequency_hz, rest.cycles_per_pitch) == (1.5, 1.0)
    assert (message.held_out_split, message.held_out_blocks) == ('blocks', 12)
    (gain,) = message.gain
    assert (gain.channel, gain.chi2_before, gain.nrmse_after) == ('chain/pull', 400.0, 0.25)
    assert math.isnan(gain.chi2_after)
    assert len(message.recordings) == 1


@pytest.mark.usefixtures('nodes')
@pytest.mark.parametrize(
    ('fields', 'text'),
    [
        ({'seed': REFUSING}, 'the stand-in refuses'),
        ({'seed': DYING}, 'the diagnosis has ended with status 7'),
        ({'bags': ['nowhere']}, 'nowhere: no such file'),
    ],
)
def test_failure_is_told_in_one_line_and_the_node_lives(asker, fields, text):
    from action_msgs.msg import GoalStatus

    status, result = asker.ask(**fields)
    assert (status, result.success, result.json) == (GoalStatus.STATUS_ABORTED, False, '')
    assert text in result.message
    assert '\n' not in result.message


@pytest.mark.usefixtures('nodes')
@pytest.mark.parametrize(
    ('seed', 'status', 'text'),
    [(1, 0, 'tensioner_stiffness: factor 0.5'), (REFUSING, 1, 'the stand-in refuses')],
)
def test_ask_prints_what_was_found_or_why_not(tmp_path, seed, status, text):
    target = tmp_path / 'found.json'
    # what follows the second mark is not ROS's
    words = ['--', '--seed', str(seed), '--json', str(target)]
    asked = Program('ask', tmp_path / 'ask.log', {}, words)
    assert asked.wait() == status
    assert text in asked.text
    assert 'Traceback' not in asked.text
    assert target.exists() == (status == 0)
    if status == 0:
        assert json.loads(target.read_text())['schema'] == 'escalator_twin/diagnosis/1'


@pytest.mark.usefixtures('nodes')
def test_diagnosis_can_be_cancelled_and_only_one_runs(asker):
    from action_msgs.msg import GoalStatus

    told = []
    handle = asker.send(told, seed=ENDLESS)
    assert handle.accepted
    asker.wait(lambda: len(told) > 3)
    assert not asker.send(seed=1).accepted
    result = handle.get_result_async()
    assert len(asker.wait_for(handle.cancel_goal_async()).goals_canceling) == 1
    assert asker.wait_for(result).status == GoalStatus.STATUS_CANCELED
    assert asker.ask(seed=1)[1].success


@pytest.mark.usefixtures('nodes')
def test_simulator_refuses_a_machine_with_other_topics(asker):
    for path, text in ((PROTOTYPE, 'expected the topics'), ('nowhere.yaml', 'cannot be read')):
        answer = _set_machine(asker, str(path))
        assert not answer.successful
        assert text in answer.reason, answer.reason


def _set_machine(asker, path):
    from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
    from rcl_interfaces.srv import SetParameters

    value = ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=path)
    wanted = [Parameter(name='machine', value=value)]
    return asker.call(SetParameters, '/simulator/set_parameters', parameters=wanted).results[0]


def test_simulator_takes_the_extended_machine_over_and_the_next_passage_shows_it(
    asker, nodes, toy_bag, tmp_path
):
    from escalator_msgs.msg import Comparison

    comparator, folder = nodes
    heard = asker.collect(Comparison, 'comparator/comparison')
    status_and_result = asker.ask(seed=1, hand_over=True)
    extended = status_and_result[1].extended_machine
    assert status_and_result[1].success
    asker.wait(lambda: any(message.final for message in heard), timeout=120.0)
    comparator.wait_for('live_extended.yaml')
    asker.wait(lambda: (folder / 'live_extended.json').is_file())
    limit = time.monotonic() + 20.0
    while comparator.text.count('compared ') < 2:
        assert time.monotonic() < limit
        time.sleep(0.1)
    live = json.loads((folder / 'live_extended.json').read_text())
    assert live['machine'] == extended
    file = tmp_path / 'offline.json'
    assert main(['compare', str(toy_bag), '--machine', extended, '--json', str(file)]) == 0
    same(live['recordings'], json.loads(file.read_text())['recordings'])
    before = json.loads((folder / 'live.json').read_text())['recordings'][0]['channels']
    after = live['recordings'][0]['channels']
    assert any(abs(before[name]['nrmse'] - after[name]['nrmse']) > 0.01 for name in before)
    # and back: one command
    assert _set_machine(asker, str(TOY)).successful
