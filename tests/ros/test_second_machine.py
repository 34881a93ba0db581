"""Both nodes on the second machine, with what its instruments measure."""

import json

import pytest

from escalator_twin import bagfile
from escalator_twin.cli.main import main
from escalator_twin.machine import load_machine

from .conftest import ROOT
from .programs import program
from .test_replay import same

pytestmark = [pytest.mark.ros, pytest.mark.slow, pytest.mark.issue(8)]

KWON = ROOT / 'config' / 'machines' / 'kwon.yaml'
SECONDS = 8


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    """Return a recording of the second machine by the twin, instruments' errors included."""
    folder = tmp_path_factory.mktemp('second')
    words = [
        '--duration',
        str(SECONDS),
        '--start-s',
        '4.2',
        '--instruments',
        'real',
        '--seed',
        '7',
    ]
    made = folder / 'simulated'
    assert main(['simulate', '--machine', str(KWON), *words, '--out', str(made)]) == 0
    machine = load_machine(KWON)
    bagfile.write(folder / 'bag', bagfile.read(made, machine), machine, namespace='/measured')
    return folder / 'bag'


def test_a_replay_beside_the_simulator_gives_the_numbers_of_the_command_line(bag, tmp_path):
    given = {'machine': KWON, 'rate': 2, 'bag': bag, 'exit_at_end': True}
    given |= {'json': tmp_path / 'live.json', 'session': tmp_path / 'session'}
    with (
        program('simulator', tmp_path, machine=KWON, autostart=False) as simulator,
        program('comparator', tmp_path, **given) as comparator,
    ):
        assert comparator.wait(300.0) == 0, comparator.text
        assert simulator.interrupt() == 0, simulator.text
    assert ' 0 lost, 0 out of order' in comparator.text
    file = tmp_path / 'offline.json'
    assert main(['compare', str(bag), '--machine', str(KWON), '--json', str(file)]) == 0
    offline = json.loads(file.read_text())['recordings'][0]
    live = json.loads((tmp_path / 'live.json').read_text())['recordings'][0]
    same(live, offline)
    assert live['channels']['chain/tension']['r_time'] > 0.99
    # every instrument of the description, measured and simulated, is in the session
    counts = {info.topic: info.n_messages for info in bagfile.topics(tmp_path / 'session')}
    measured = {info.topic: info.n_messages for info in bagfile.topics(bag)}
    for sensor in load_machine(KWON).instruments.sensors:
        topic = f'/measured/{sensor.topic}'
        assert counts[topic] == measured[topic] > 100 * SECONDS
        assert counts[f'/simulated/{sensor.topic}'] > 100 * SECONDS
