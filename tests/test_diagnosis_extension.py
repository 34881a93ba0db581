"""An extended machine is a description that loads and runs as it stands, and tells its origin."""

import hashlib

import numpy as np
import pytest
import trials
import yaml

from escalator_twin import __version__
from escalator_twin.diagnosis.extension import extension, fingerprint, write_extension
from escalator_twin.machine import Deviation, load_machine

pytestmark = pytest.mark.issue(7)

ACCEPTED = (
    {'cause': 'roller_drag', 'location': {'axle': 7, 'side': 'left'},
     'parameters': {'force_N': 120.0}},
    {'cause': 'rolling_resistance', 'parameters': {'factor': 1.6}},
)  # fmt: skip
EFFECTS = [{**one, 'parameters': {}, 'probability': 0.9, 'alternatives': []} for one in ACCEPTED]
SECONDS = 2.0


@pytest.fixture
def written(tmp_path):
    bag = tmp_path / 'bag'
    bag.mkdir()
    (bag / 'a.mcap').write_bytes(b'abc')
    (bag / 'metadata.yaml').write_bytes(b'def')
    path = tmp_path / 'here' / 'extended.yaml'
    description = extension(trials.prototype(), path.parent, [str(bag)], EFFECTS, ACCEPTED, seed=5)
    write_extension(path, description)
    return path, bag


def test_it_loads_with_the_accepted_deviations_and_nothing_else(written):
    machine = load_machine(written[0])
    assert machine.deviations == (
        Deviation('roller_drag', {'force_N': 120.0}, {'axle': 7, 'side': 'left'}),
        Deviation('rolling_resistance', {'factor': 1.6}, {}),
    )
    plain = trials.prototype()
    assert machine.chain == plain.chain
    assert machine.instruments == plain.instruments


def test_numbers_of_numpy_are_written_as_numbers(tmp_path):
    path = tmp_path / 'extended.yaml'
    accepted = [
        {'cause': 'load_distribution', 'location': {'steps': [np.int64(3), np.int64(4)]},
         'parameters': {'load_factor': np.float64(0.25)}},
    ]  # fmt: skip
    told = [{'value': np.float64(0.25), 'of': (np.int64(3),)}]
    write_extension(path, extension(trials.prototype(), tmp_path, [], told, accepted, seed=5))
    (deviation,) = load_machine(path).deviations
    assert deviation == Deviation('load_distribution', {'load_factor': 0.25}, {'steps': [3, 4]})


def test_it_runs_as_the_machine_with_these_deviations(written):
    known = trials.trial(
        (trials.deviation('roller_drag', {'axle': 7, 'side': 'left'}, force_N=120.0),
         trials.deviation('rolling_resistance', factor=1.6)),
        duration_s=SECONDS,
    )  # fmt: skip
    plain = trials.trial(duration_s=SECONDS)
    extended = trials.trial(duration_s=SECONDS, machine=load_machine(written[0]))
    np.testing.assert_array_equal(extended.columns, known.columns)
    assert np.std(trials.changed(extended, plain)) > 0.0


def test_it_tells_where_it_comes_from(written):
    path, bag = written
    told = yaml.safe_load(path.read_text(encoding='utf-8'))['provenance']
    assert told['tool'] == f'escalator_twin {__version__}'
    assert told['seed'] == 5
    expected = hashlib.sha256(b'a.mcapabcmetadata.yamldef').hexdigest()
    assert told['recordings'] == [{'path': str(bag), 'sha256': expected}]
    source = trials.prototype().source
    digest = hashlib.sha256(source.name.encode() + source.read_bytes()).hexdigest()
    assert told['extends_sha256'] == digest
    assert [e['cause'] for e in told['effects']] == [e['cause'] for e in ACCEPTED]


def test_another_byte_is_another_recording(written):
    _, bag = written
    before = fingerprint(str(bag))
    (bag / 'a.mcap').write_bytes(b'abd')
    assert fingerprint(str(bag)) != before


def test_nothing_accepted_is_the_machine_itself(tmp_path):
    path = tmp_path / 'extended.yaml'
    write_extension(path, extension(trials.prototype(), tmp_path, [], [], [], 0))
    assert load_machine(path).deviations == ()
