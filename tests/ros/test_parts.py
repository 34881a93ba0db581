"""Parts of the nodes that need no second process."""

import importlib.util
import json

import numpy as np
import pytest

from escalator_twin.machine import load_machine
from escalator_twin.physics.rollout import Trace

from .conftest import PROTOTYPE, ROOT, TOY

pytestmark = [pytest.mark.ros, pytest.mark.issue(2)]

OFFERED = """
- history: 1
  depth: 10
  reliability: {reliability}
  durability: {durability}
"""


@pytest.mark.parametrize(
    ('reliability', 'durability', 'expected'),
    [
        ('1', '2', ('RELIABLE', 'VOLATILE')),
        ('best_effort', 'volatile', ('BEST_EFFORT', 'VOLATILE')),
        ('2', '1', ('BEST_EFFORT', 'TRANSIENT_LOCAL')),
        ('reliable', 'transient_local', ('RELIABLE', 'TRANSIENT_LOCAL')),
    ],
)
@pytest.mark.parametrize('is_text', [True, False], ids=['text', 'list'])
def test_recorded_policies_are_kept(tmp_path, reliability, durability, expected, is_text):
    import yaml

    from escalator_twin.ros.recorded_qos import recorded_qos

    offered = OFFERED.format(reliability=reliability, durability=durability)
    topic = {
        'name': '/a',
        'type': 'std_msgs/msg/String',
        'serialization_format': 'cdr',
        'offered_qos_profiles': offered if is_text else yaml.safe_load(offered),
    }
    about = {'topics_with_message_count': [{'topic_metadata': topic, 'message_count': 1}]}
    file = tmp_path / 'metadata.yaml'
    file.write_text(yaml.safe_dump({'rosbag2_bagfile_information': about}))
    profile = recorded_qos(str(tmp_path))['/a']
    assert (profile.reliability.name, profile.durability.name) == expected
    # deep enough for a second of the fastest sensor
    assert profile.depth >= 1000


def heard_run(machine, rows):
    """Return a run that has heard the toy's topics but for some rows of the first one."""
    from escalator_twin.ros.heard import HeardRun
    from escalator_twin.ros.outputs import Encoder, POSITION, SensorEncoder

    n, n_sensors = 50, len(machine.instruments.sensors + machine.instruments.simulated_only)
    columns = np.arange(n)[:, None] + 100.0 * np.arange(n_sensors)
    stamps = 10**9 + 5_000_000 * np.arange(n)
    run = HeardRun(machine)
    run.set_time(10**9, 200.0)
    for number, part in enumerate(run.parts):
        if part.output.sensors:
            messages = SensorEncoder(part.output).encode(stamps, columns)
        else:
            place = (7.9 + 0.01 * np.arange(n))[:, None] % 8.0
            messages = Encoder(part.output.type, {}, (POSITION,)).encode(stamps, place)
        chosen = rows if number == 0 else range(n)
        for row in chosen:
            run.take(number, messages[row])
    run.decode()
    return run, columns


def test_a_run_is_heard_as_it_was_simulated():
    machine = load_machine(TOY)
    run, columns = heard_run(machine, range(50))
    trace = run.trace(8.0)
    assert isinstance(trace, Trace)
    assert (run.n_lost, run.n_disordered) == (0, 0)
    n_sensors = len(machine.instruments.sensors)
    np.testing.assert_allclose(trace.columns, columns[:, :n_sensors], rtol=1e-14)
    np.testing.assert_allclose(trace.place_m, 7.9 + 0.01 * np.arange(50), atol=1e-12)
    np.testing.assert_array_equal(trace.time_s, np.arange(50) / 200.0)


def test_losses_and_disorder_are_counted_and_gaps_filled():
    machine = load_machine(TOY)
    rows = [0, 1, 2, 5, 6, 8, 7, *range(9, 50)]
    run, columns = heard_run(machine, rows)
    assert run.n_lost == 2
    assert run.n_disordered == 1
    first = run.parts[0].output.columns[0]
    np.testing.assert_allclose(run.trace(8.0).columns[:, first], columns[:, first], rtol=1e-12)


def test_samples_of_an_earlier_run_are_left_out():
    machine = load_machine(TOY)
    run, columns = heard_run(machine, [40, 41, 42, *range(50)])
    assert run.parts[0].n_stale == 3
    assert (run.n_lost, run.n_disordered) == (0, 0)
    first = run.parts[0].output.columns[0]
    np.testing.assert_allclose(run.trace(8.0).columns[:, first], columns[:, first], rtol=1e-14)


def test_layout_has_every_channel_measured_over_simulated():
    from escalator_twin.ros.layout import layout

    for path in (PROTOTYPE, TOY):
        machine = load_machine(path)
        made = layout(machine)
        titles = [plot['title'] for plot in made['configById'].values()]
        assert titles == [s.channel for s in machine.instruments.sensors]
        placed = json.dumps(made['layout'])
        assert all(f'"{name}"' in placed for name in made['configById'])


def test_launch_file_describes_both_nodes():
    pytest.importorskip('launch_ros', reason='the wheels hold no launch')
    path = ROOT / 'escalator_twin' / 'launch' / 'twin.launch.py'
    spec = importlib.util.spec_from_file_location('twin_launch', path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    actions = module.generate_launch_description().entities
    assert [a.node_executable for a in actions if hasattr(a, 'node_executable')] == [
        'simulator',
        'comparator',
    ]
