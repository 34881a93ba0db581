"""What is spoiled of a recording is what is said, and all else stays."""

from makers import prototype, synthetic
import numpy as np
import pytest

from benchmarks.spoiled import WAYS
from escalator_twin import bagfile
from escalator_twin.check import quality

pytestmark = pytest.mark.issue(6)

MACHINE = prototype()
LINKS = {f'link_force/{name}' for name in ('left_a', 'left_b', 'right_a', 'right_b')}
STEPS = {f'step/acceleration/{axis}' for axis in 'xyz'}
WAYS_OF = {'tensioner/displacement'}
FIRST = {'link_force/left_a'}
# what each way changes: channels, or the experiment
TOUCHED = {
    'as it is': set(),
    'a link holds its value for 5 %': FIRST,
    'a link dies at 40 %': FIRST,
    'a link reads zero': FIRST,
    'a link reads the wrong way': FIRST,
    'the tensioner reads the wrong way': WAYS_OF,
    '3 % of the accelerations are lost': STEPS,
    'no tensioner': WAYS_OF,
    'no accelerations': STEPS,
    'no links': LINKS,
    'accelerations alone': LINKS | WAYS_OF,
    'six seconds at rest at both ends': LINKS | STEPS | WAYS_OF,
    'accelerations in g': STEPS,
    'the tensioner in mm': WAYS_OF,
    'the wrong direction said': {'experiment'},
}


@pytest.fixture(scope='module')
def recording():
    return synthetic(MACHINE, 20.0)


def test_every_way_is_looked_at():
    assert set(TOUCHED) == set(WAYS)


@pytest.mark.parametrize('name', WAYS)
def test_a_way_spoils_what_it_says_and_is_written(recording, tmp_path, name):
    spoiled = WAYS[name](recording, MACHINE)
    changed = {
        c
        for c, s in recording.signals.items()
        if c not in spoiled.signals or not np.array_equal(s.values, spoiled.signals[c].values)
    }
    if spoiled.experiment != recording.experiment:
        changed.add('experiment')
    assert changed == TOUCHED[name]
    bagfile.write(tmp_path / 'bag', spoiled, MACHINE, '/measured')
    again = bagfile.read(tmp_path / 'bag', MACHINE)
    assert set(again.signals) == set(spoiled.signals)
    assert again.experiment.direction == spoiled.experiment.direction


def test_a_held_value_stands_still(recording):
    held = WAYS['a link holds its value for 5 %'](recording, MACHINE)
    told = [f for f in quality(held, MACHINE) if 'stands still' in f.detail]
    assert [f.channel for f in told] == ['link_force/left_a']
    assert told[0].to_s - told[0].from_s == pytest.approx(1.0, abs=0.05)
