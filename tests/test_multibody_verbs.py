"""The verbs and the nodes' run on the second machine."""

import json

import kwons
import numpy as np
import pytest

from escalator_twin import bagfile
from escalator_twin.cli.main import main
from escalator_twin.physics.course import course_of
from escalator_twin.ros.outputs import outputs_of, sensors_of
from escalator_twin.ros.run import Order, record_rate, Run
from escalator_twin.twin import make_simulation

pytestmark = pytest.mark.issue(8)

FILE = kwons.MACHINES / 'kwon.yaml'
# contracts.md, topics and channels
NAMED = {'step/acceleration/x', 'roller/reaction', 'chain/tension', 'gear/torque',
         'handrail/tension', 'handrail/speed'}  # fmt: skip


def test_the_description_has_the_contracts_channels():
    assert {s.channel for s in kwons.kwon().instruments.sensors} >= NAMED


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    """Return a second of the second machine, by the verb."""
    out = tmp_path_factory.mktemp('kwon') / 'bag'
    status = main(['simulate', '--machine', str(FILE), '--duration', '1', '--start-s', '4.2',
                   '--out', str(out)])  # fmt: skip
    assert status == 0
    return out


def test_simulate_writes_every_output(bag):
    recording = bagfile.read(bag, kwons.kwon())
    assert set(recording.signals) >= NAMED
    speed = recording.signals['handrail/speed'].values
    assert speed.mean() == pytest.approx(0.510, rel=0.02)
    topics = {info.topic for info in bagfile.topics(bag)}
    assert {'/simulated/gear/motor_torque', '/simulated/pulley/torque',
            '/simulated/pulley/motor_torque', '/simulated/step/speed'} <= topics  # fmt: skip


def test_check_reads_it(bag, tmp_path):
    file = tmp_path / 'check.json'
    assert main(['check', str(bag), '--machine', str(FILE), '--json', str(file)]) == 0
    found = json.loads(file.read_text())
    assert not [q for q in found['quality'] if q['kind'] not in ('missing_topic',)]


def test_a_nodes_run_gives_samples_of_all_outputs():
    machine = kwons.kwon()
    sensors, outputs = sensors_of(machine), outputs_of(machine)
    assert {i for output in outputs for i in output.columns} == set(range(len(sensors)))
    simulation = make_simulation(machine, machine.default_experiment())
    simulation.rest(3.0)
    rate = record_rate(machine, 0.0, simulation.step_s)
    order = Order(machine.default_experiment(), 3.0, 0.1)
    run = Run(order, simulation, rate, 1000)
    assert run.advance(30, sensors) is not None  # part of a sample, then whole ones
    batch = run.advance(1000, sensors)
    assert batch.columns.shape == (19, len(sensors))
    assert run.is_done
    assert np.all((batch.place_m >= 0.0) & (batch.place_m < course_of(machine).length_m + 0.05))


def test_a_wrong_description_is_one_clear_line(tmp_path, capsys):
    file = tmp_path / 'wrong.yaml'
    text = f'extends: {FILE}\nname: wrong\nguide: {{turnaround_radius_m: 0.4}}\n'
    file.write_text(text, encoding='utf-8')
    out = str(tmp_path / 'bag')
    assert main(['simulate', '--machine', str(file), '--duration', '1', '--out', out]) == 2
    assert 'a gear of 5 seats' in capsys.readouterr().err
