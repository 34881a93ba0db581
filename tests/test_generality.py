"""A machine of other size, instruments, topics and units runs by description alone."""

from dataclasses import replace
import json
from pathlib import Path
import re

import pytest

from escalator_twin import bagfile, pipeline
from escalator_twin.cli.main import main
from escalator_twin.machine import load_machine
from escalator_twin.physics.path import build_path

pytestmark = pytest.mark.issue(2)

TOY = Path(__file__).parent / 'data' / 'toy.yaml'
SPEED, START, DURATION = 0.293, 0.71, 24.0


@pytest.fixture(scope='module')
def toy_bag(tmp_path_factory):
    """Return a bag of the toy's own instruments, written under the names of a measurement."""
    folder = tmp_path_factory.mktemp('toy')
    simulated, measured = folder / 'simulated', folder / 'measured'
    case = f'speed={SPEED},direction=down,load=1.5,preload=900'
    status = main(
        ['simulate', '--machine', str(TOY), '--case', case, '--duration', str(DURATION),
         '--start-s', str(START), '--instruments', 'real', '--seed', '5', '--out', str(simulated)]
    )  # fmt: skip
    assert status == 0
    machine = load_machine(TOY)
    recording = bagfile.read(simulated, machine)
    # the operator's set speed is not the real one
    experiment = replace(recording.experiment, set_speed_m_s=0.3)
    recording = replace(recording, experiment=experiment)
    bagfile.write(measured, recording, machine, namespace='/bench')
    return measured


def test_topics_types_and_units_are_the_descriptions(toy_bag):
    infos = {i.topic: i.type for i in bagfile.topics(toy_bag)}
    assert infos['/bench/loadcell/pull'] == 'geometry_msgs/msg/WrenchStamped'
    assert infos['/bench/laser'] == 'geometry_msgs/msg/PointStamped'
    assert infos['/bench/plate/imu'] == 'sensor_msgs/msg/Imu'
    raw = list(bagfile.messages(toy_bag, ['/bench/laser']))
    assert len(raw) == pytest.approx(50 * DURATION, abs=2)


def test_compare_finds_speed_place_and_agreement(toy_bag, tmp_path):
    file = tmp_path / 'toy.json'
    assert main(['compare', str(toy_bag), '--machine', str(TOY), '--json', str(file)]) == 0
    found = json.loads(file.read_text())['recordings'][0]
    assert found['direction'] == -1
    assert found['speed_m_s']['value'] == pytest.approx(SPEED, rel=1e-3)
    length = build_path(load_machine(TOY).guide).length_m
    error = (found['start_s_m'] - START + length / 2) % length - length / 2
    assert abs(error) < 0.015
    assert set(found['channels']) == {
        'chain/pull',
        'take_up/way',
        'plate/shock/x',
        'plate/shock/z',
    }
    for scores in found['channels'].values():
        assert scores['r_time'] > 0.99


def test_no_channel_of_one_machine_is_in_the_code():
    package = Path(pipeline.__file__).parent
    words = re.compile(r'\b(left_a|left_b|right_a|right_b|tensioner/displacement|measured/link)\b')
    for path in package.rglob('*.py'):
        text = path.read_text(encoding='utf-8')
        assert not words.findall(text), path
