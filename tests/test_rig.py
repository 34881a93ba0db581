"""The independent generator: what it promises about itself and its recordings."""

import ast
from dataclasses import astuple, replace
import hashlib
import json
from pathlib import Path
import shutil
import sys

from mcap.reader import make_reader
import numpy as np
import pytest
from rig.bagfile import DEFINITIONS
from rig.hidden import Plan, plan, write_hidden, write_plan
from rig.instruments import ACCELERATION_STEP, LINKS, REFLEX_STEP, STRAIN_STEP
from rig.machine import Case
from rig.make import (
    Effect,
    make,
    Order,
    write,
)
from rosbags.highlevel import AnyReader
import yaml

pytestmark = pytest.mark.issue(4)

TESTS = Path(__file__).resolve().parent
RIG_FILES = sorted((TESTS / 'rig').glob('*.py'))
ALLOWED = {'rig', 'numpy', 'scipy', 'numba', 'yaml', 'rosbags', 'threadpoolctl'}
CASE = Case(0.5, 1, 75.0, 3000.0)
SHORT_S = 3.0  # s, of the recordings made here
COARSE_S = 5e-4  # s, integration step where only a change is looked for


def imported(path: Path) -> set[str]:
    """Return the top-level names of everything a file imports, lazy imports too."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name.split('.')[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names.add('relative' if node.level else (node.module or '').split('.')[0])
    return names


@pytest.mark.parametrize('path', RIG_FILES, ids=lambda path: path.name)
def test_the_rig_imports_nothing_of_the_project(path):
    assert imported(path) - set(sys.stdlib_module_names) <= ALLOWED


def bodies(path: Path) -> set[str]:
    """Return the functions of a file that are long enough to be copied, names of locals kept."""
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.FunctionDef):
            body = node.body[1:] if ast.get_docstring(node) else node.body
            if sum(1 for part in body for _ in ast.walk(part)) > 60:
                found.add('\n'.join(ast.dump(part) for part in body))
    return found


def test_the_rig_shares_no_function_with_the_twin(root):
    twin = set()
    for path in (root / 'escalator_twin' / 'escalator_twin').rglob('*.py'):
        twin |= bodies(path)
    own = set().union(*(bodies(path) for path in RIG_FILES))
    assert twin
    assert not own & twin


@pytest.fixture(scope='module')
def made():
    return make(Order(7, CASE, SHORT_S))


@pytest.fixture(scope='module')
def bag(made, tmp_path_factory):
    directory = tmp_path_factory.mktemp('rig') / 'some'
    write(made, directory, None)
    return directory


def messages(directory: Path) -> list[tuple[str, int, bytes]]:
    """Return topic, bag time and bytes of every message."""
    with AnyReader([directory]) as reader:
        return [(c.topic, t, bytes(raw)) for c, t, raw in reader.messages()]


def test_same_seed_gives_same_bytes_in_every_message(bag, tmp_path):
    write(make(Order(7, CASE, SHORT_S)), tmp_path / 'again', None)
    assert messages(tmp_path / 'again') == messages(bag)


def test_another_seed_gives_another_recording(made):
    other = make(Order(8, CASE, SHORT_S))
    assert other.truth['speed_m_s'] != made.truth['speed_m_s']
    assert other.truth['tolerances'] != made.truth['tolerances']


def test_one_machine_keeps_its_tolerances_in_another_recording(made):
    other = make(Order(8, Case(0.5, -1, 0.0, 6000.0), SHORT_S, machine_seed=7))
    assert other.truth['tolerances'] == made.truth['tolerances']
    assert other.truth['clock'] != made.truth['clock']


def test_topics_and_types_are_those_of_the_data_sheet(bag):
    with AnyReader([bag]) as reader:
        topics = {c.topic: (c.msgtype, c.msgcount) for c in reader.connections}
    strain = 'escalator_msgs/msg/LinkStrain'
    samples = int(SHORT_S * 200)
    assert topics == {
        '/measured/experiment': ('escalator_msgs/msg/Experiment', 1),
        **{f'/measured/link/{link}/strain': (strain, samples) for link in LINKS},
        '/measured/step/acceleration': ('sensor_msgs/msg/Imu', samples),
        '/measured/tensioner/displacement': (
            'escalator_msgs/msg/TensionerDisplacement',
            samples // 2,
        ),
    }


def test_readings_are_whole_steps_of_the_resolution(bag):
    with AnyReader([bag]) as reader:
        for connection, _, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            if connection.topic.endswith('strain'):
                steps = np.asarray(message.strain) / STRAIN_STEP
            elif connection.topic.endswith('acceleration'):
                steps = np.array([message.linear_acceleration.x]) / ACCELERATION_STEP
                assert message.orientation_covariance[0] == -1.0
                assert message.angular_velocity_covariance[0] == -1.0
            elif connection.topic.endswith('displacement'):
                steps = np.array([message.displacement]) / REFLEX_STEP
            else:
                continue
            assert np.abs(steps - np.round(steps)).max() < 1e-6


def test_the_file_is_one_zstd_mcap_with_definitions(bag):
    with (bag / 'some.mcap').open('rb') as stream:
        summary = make_reader(stream).get_summary()
    assert {index.compression for index in summary.chunk_indexes} == {'zstd'}
    texts = {schema.name: schema.data.decode() for schema in summary.schemas.values()}
    for name, text in DEFINITIONS.items():
        assert texts[name].startswith(text)


@pytest.mark.shared
def test_definitions_equal_those_of_the_seeded_recordings(bag, shared):
    def schemas(path: Path) -> dict[str, bytes]:
        with path.open('rb') as stream:
            return {s.name: s.data for s in make_reader(stream).get_summary().schemas.values()}

    theirs = shared / 'measured' / 'seeded' / 'clean_1' / 'clean_1.mcap'
    assert schemas(bag / 'some.mcap') == schemas(theirs)


def test_clocks_are_those_of_the_truth(made):
    series = {s.topic: s for s in made.recording.series}
    strain = series['/measured/link/left_a/strain']
    ground = series['/measured/tensioner/displacement']
    late_s = (strain.bag_ns - strain.stamp_ns) * 1e-9
    recorder_s = np.mean((ground.bag_ns - ground.stamp_ns) * 1e-9)
    assert recorder_s - late_s.mean() == pytest.approx(
        made.truth['clock']['offset_s'], abs=3e-4
    )  # s: drift over half the recording and the mean of 600 latencies


def test_an_unknown_cause_is_refused():
    with pytest.raises(ValueError, match="unknown cause 'rust'"):
        make(Order(7, CASE, 0.1, (Effect('rust'),)))


def test_a_hidden_set_keeps_its_truth_apart(tmp_path):
    chosen = plan(0, 11, 1, ['roller_drag'])
    order = chosen.orders[0]
    short = Order(order.seed, order.case, 0.5, order.effects, machine_seed=order.machine_seed)
    line = write_plan(type(chosen)(chosen.name, chosen.cause, chosen.size, (short,)), tmp_path)
    assert line == {'name': 'machine_000', 'recordings': ['machine_000_0']}
    truth = json.loads((tmp_path / 'truth' / 'machine_000_0.json').read_text())
    assert truth['effects'][0]['cause'] == 'roller_drag'
    assert b'roller_drag' not in (tmp_path / 'machine_000_0' / 'machine_000_0.mcap').read_bytes()


def short_machine(seed: int) -> Plan:
    """Return a machine with a stop and two recordings of two seconds, at two preloads."""
    chosen = plan(0, seed, 2, ['tensioner_stop'])
    cases = (Case(0.5, 1, 0.0, 3000.0), Case(0.5, 1, 0.0, 6000.0))
    orders = tuple(
        replace(order, case=case, duration_s=2.0)
        for order, case in zip(chosen.orders, cases, strict=True)
    )
    return replace(chosen, orders=orders)


@pytest.mark.issue(7)
def test_a_machine_has_one_stop_in_all_its_recordings(tmp_path):
    line = write_plan(short_machine(8), tmp_path)
    truths = [
        json.loads((tmp_path / 'truth' / f'{name}.json').read_text())
        for name in line['recordings']
    ]
    stops = [truth['effects'][0]['parameters'] for truth in truths]
    assert stops[0] == stops[1]
    assert stops[0].keys() == {'displacement_m'}


@pytest.mark.issue(6)
def test_an_interrupted_set_goes_on(tmp_path):
    whole, left = tmp_path / 'whole', tmp_path / 'left'
    write_hidden([short_machine(12)], 12, whole)
    shutil.copytree(whole, left)
    finished = left / 'machine_000_0' / 'machine_000_0.mcap'
    before = finished.stat().st_mtime_ns
    # As a run leaves it that is stopped in the second recording.
    (left / 'manifest.json').unlink()
    (left / 'truth' / 'machine_000_1.json').unlink()
    (left / 'machine_000_1' / 'metadata.yaml').unlink()
    write_hidden([short_machine(12)], 12, left, keep=True)
    assert finished.stat().st_mtime_ns == before
    for name in ('manifest.json', 'truth/machine_000_1.json', 'machine_000_1/machine_000_1.mcap'):
        assert (left / name).read_bytes() == (whole / name).read_bytes()


@pytest.mark.issue(6)
def test_another_set_is_not_taken_over(tmp_path):
    chosen = short_machine(12)
    made = replace(chosen, orders=chosen.orders[:1])
    write_hidden([made], 12, tmp_path)
    seed = replace(made, orders=(replace(made.orders[0], seed=13000),))
    with pytest.raises(ValueError, match=r'machine_000_0: expected seed.* \(13000, .*\(12000,'):
        write_hidden([seed], 12, tmp_path, keep=True)
    size = replace(made, size='third')
    with pytest.raises(ValueError, match=r"'third'\), found .*'reference'\)"):
        write_hidden([size], 12, tmp_path, keep=True)


def test_several_causes_are_hidden_in_all_experiments_of_a_machine():
    chosen = plan(0, 11, 16, effects=3)
    names = {tuple(e.cause for e in order.effects) for order in chosen.orders}
    (causes,) = names
    assert len(set(causes)) == 3
    cases = {astuple(order.case) for order in chosen.orders}
    assert len(cases) == 16
    assert len({order.machine_seed for order in chosen.orders}) == 1


def test_the_seed_decides_cause_size_place_and_experiment():
    again = [[plan(i, 3, 2) for i in range(40)] for _ in range(2)]
    assert again[0] == again[1]
    assert len({p.cause for p in again[0]}) > 15
    assert {p.size for p in again[0]} == {None, 'third', 'reference', 'twice'}
    assert all(
        e.parameters.get('factor', 1.0) >= 0.0 for p in again[0] for e in p.orders[0].effects
    )


def test_sample_bags_are_those_of_the_manifest(root):
    manifest = yaml.safe_load((root / 'bags' / 'manifest.yaml').read_text())
    for entry in manifest.values():
        file = root / 'bags' / entry['file']
        assert file.stat().st_size < 4_000_000  # bytes, the issue's limit
        assert hashlib.sha256(file.read_bytes()).hexdigest() == entry['sha256']
