"""A foreign bag, other names and units: the map is drafted, edited and then all that is needed."""

import json

from makers import message, PROTOTYPE, prototype, Raw, raw, stamp, START_NS, STORE, write_mcap
import numpy as np
import pytest
import yaml

from escalator_twin import bagfile
from escalator_twin.cli.main import main
from escalator_twin.errors import MachineError
from escalator_twin.machine import load_machine
from escalator_twin.suggest import suggest

pytestmark = pytest.mark.issue(2)

MACHINE = prototype()
N = 800
GRAVITY = 9.80665

# What the user keeps of the draft: topics, fields, scales and signs; no code.
MAP = f"""
extends: {PROTOTYPE}
name: rig 7
instruments:
  loggers:
    ground: {{offset_s: 0.0, drift_ppm: 0.0}}
    on_board: {{offset_s: 2.0, drift_ppm: 50.0}}
  experiment: null
  simulated_only: []
  sensors:
    - {{instrument: link_force, name: left_a, quantity: link_force, at: {{link: 0, side: left}},
       unit: N, topic: /rig7/loadcell, type: geometry_msgs/msg/WrenchStamped,
       fields: [wrench.force.y], scale: 1000.0, sign: -1, logger: on_board, rate_hz: 200.0}}
    - {{instrument: step, name: acceleration/x, quantity: step_acceleration,
       at: {{step: 0, axis: x}}, unit: m/s2, topic: /rig7/imu, type: sensor_msgs/msg/Imu,
       fields: [linear_acceleration.z], scale: 9.80665, sign: 1, logger: on_board,
       rate_hz: 200.0}}
    - {{instrument: tensioner, name: displacement, quantity: carriage_displacement, at: {{}},
       unit: m, topic: /rig7/laser, type: std_msgs/msg/Float64, fields: [data], scale: 1.0e-3,
       sign: 1, offset: 0.010, logger: ground, rate_hz: 100.0}}
"""


def rig_messages() -> list[Raw]:
    rng = np.random.default_rng(1)
    rows = []
    for k in range(N):
        own = START_NS + 700_000_000 + 5_000_000 * k
        bag = START_NS + 5_000_000 * k + 4_000_000 + int(rng.integers(0, 500_000))
        wrench = message('geometry_msgs/msg/WrenchStamped', wrench__force__y=force_kn(k))
        rows.append(
            raw('/rig7/loadcell', 'geometry_msgs/msg/WrenchStamped', bag, stamp(wrench, own))
        )
        imu = message('sensor_msgs/msg/Imu', linear_acceleration__z=acceleration_g(k))
        rows.append(raw('/rig7/imu', 'sensor_msgs/msg/Imu', bag, stamp(imu, own)))
        if k % 2 == 0:
            laser = message('std_msgs/msg/Float64', data=laser_mm(k))
            rows.append(raw('/rig7/laser', 'std_msgs/msg/Float64', bag, laser))
        if k % 100 == 0:
            heat = message('sensor_msgs/msg/Temperature', temperature=30.0 + k / 100)
            rows.append(raw('/rig7/motor', 'sensor_msgs/msg/Temperature', bag, stamp(heat, own)))
    return rows


def force_kn(k):
    return -3.0 + 0.5 * np.sin(k / 40)


def acceleration_g(k):
    return 1.0 + 0.05 * np.cos(k / 30)


def laser_mm(k):
    return 250.0 + 2.0 * np.sin(k / 50)


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    return write_mcap(tmp_path_factory.mktemp('rig') / 'rig7.mcap', rig_messages())


@pytest.fixture(scope='module')
def machine(tmp_path_factory):
    path = tmp_path_factory.mktemp('machine') / 'rig7.yaml'
    path.write_text(MAP)
    return load_machine(path)


def test_a_foreign_bag_is_read_by_its_map_alone(bag, machine):
    recording = bagfile.read(bag, machine)
    k = np.arange(N)
    force = recording.signals['link_force/left_a']
    assert force.values == pytest.approx(-1000.0 * force_kn(k))
    assert force.stamp_ns.tolist() == (START_NS + 700_000_000 + 5_000_000 * k).tolist()
    assert recording.signals['step/acceleration/x'].values == pytest.approx(
        GRAVITY * acceleration_g(k)
    )
    laser = recording.signals['tensioner/displacement']
    assert laser.values == pytest.approx(1e-3 * laser_mm(k[::2]) + 0.010)
    assert np.array_equal(laser.stamp_ns, laser.bag_ns)  # no header: the recorder's clock
    assert recording.findings == ()


def test_a_foreign_recording_is_written_back_in_its_own_units(bag, machine, tmp_path):
    recording = bagfile.read(bag, machine)
    bagfile.write(tmp_path / 'twin', recording, machine)
    first = next(m for m in bagfile.messages(tmp_path / 'twin') if 'loadcell' in m.topic)
    assert first.topic == '/simulated/rig7/loadcell'
    made = STORE.deserialize_cdr(first.data, first.type)
    assert made.wrench.force.y == pytest.approx(force_kn(0))
    again = bagfile.read(tmp_path / 'twin', machine).signals['tensioner/displacement']
    assert again.values == pytest.approx(recording.signals['tensioner/displacement'].values)


def test_the_draft_is_a_description(bag, tmp_path):
    draft = yaml.safe_load(suggest(bag))['instruments']
    sensors = {s['topic']: s for s in draft['sensors']}
    assert sensors['/rig7/loadcell']['fields'] == ['wrench.force.y']
    assert sensors['/rig7/loadcell']['quantity'] == 'link_force'
    assert sensors['/rig7/loadcell']['scale'] == 1000.0
    assert sensors['/rig7/imu']['scale'] == pytest.approx(GRAVITY, rel=1e-5)
    assert [s['fields'] for s in draft['sensors'] if s['topic'] == '/rig7/imu'] == [
        [f'linear_acceleration.{axis}'] for axis in 'xyz'
    ]
    assert sensors['/rig7/laser']['quantity'] == 'carriage_displacement'
    assert sensors['/rig7/laser']['scale'] == 1e-3
    assert sensors['/rig7/laser']['rate_hz'] == 100.0
    assert {sensors['/rig7/imu']['logger'], sensors['/rig7/loadcell']['logger']} == {'on_board'}
    assert sensors['/rig7/laser']['logger'] == 'ground'
    path = tmp_path / 'draft.yaml'
    path.write_text(yaml.safe_dump({'extends': str(PROTOTYPE), 'instruments': draft}))
    drafted = load_machine(path)
    recording = bagfile.read(bag, drafted)
    force = recording.signals['link_force/rig7']
    assert force.values == pytest.approx(1000.0 * force_kn(np.arange(N)))  # the sign is the user's


def test_what_is_not_known_is_a_comment(bag):
    text = suggest(bag)
    assert '# /rig7/motor (sensor_msgs/msg/Temperature) temperature: 30 to 37' in text
    assert '# also there: wrench.force.x' in text
    assert 'covariance' not in text
    assert 'angular_velocity' not in text


def test_the_draft_by_the_command_line(capsys, bag, tmp_path):
    target = tmp_path / 'out.json'
    assert main(['check', str(bag), '--suggest', '--json', str(target)]) == 0
    out = capsys.readouterr().out
    assert out.startswith('# A draft')
    assert json.loads(target.read_text())['instruments'] == out


@pytest.mark.shared
def test_the_draft_of_the_prototype_is_nearly_the_prototype(shared):
    draft = yaml.safe_load(suggest(shared / 'measured' / 'seeded' / 'clean_1'))['instruments']
    drafted = {s['topic'] + str(s['fields']): s for s in draft['sensors']}
    for sensor in MACHINE.instruments.sensors:
        found = drafted[f'/measured/{sensor.topic}' + str(list(sensor.fields))]
        assert found['quantity'] == sensor.quantity
        assert f'{found["instrument"]}/{found["name"]}' == sensor.channel
        assert found['scale'] == sensor.scale
        assert found['rate_hz'] == sensor.rate_hz
        assert found['logger'] == sensor.logger
        assert found['noise'] == pytest.approx(sensor.noise, rel=1.5)  # impacts are in it
    assert len(drafted) == len(MACHINE.instruments.sensors)
    assert draft['experiment']['topic'] == '/measured/experiment'


def test_a_wrong_field_path_names_itself(tmp_path):
    path = tmp_path / 'wrong.yaml'
    path.write_text(MAP.replace('wrench.force.y', 'wrench.force..y'))
    with pytest.raises(MachineError, match=r'wrench\.force\.\.y'):
        bagfile.read(write_mcap(tmp_path / 'a.mcap', rig_messages()[:9]), load_machine(path))
