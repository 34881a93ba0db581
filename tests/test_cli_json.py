"""What the command line writes: JSON whole or not at all, and rules on it."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from shells import bag_in, GIVEN, one_line, run

from escalator_twin.cli import check
from escalator_twin.cli.output import dumps, plain, Rule, write_text
from escalator_twin.errors import EscalatorError

pytestmark = pytest.mark.issue(2)


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    return bag_in(tmp_path_factory.mktemp('cli'))


@pytest.mark.parametrize(
    ('count', 'told'), [(0, '0 findings'), (1, '1 finding'), (2, '2 findings')]
)
def test_findings_are_counted(count, told):
    row = {'kind': 'gauge_dead', 'channel': 'link_force/left_a', 'from_s': 0.0, 'to_s': 9.0}
    document = {
        'path': 'bag', 'topics': [], 'clock': {'offset_s': None, 'reason': 'one clock'},
        'container': {'losses': [], 'notes': []},
        'quality': [{**row, 'detail': 'constant', 'repaired': False}] * count,
    }  # fmt: skip
    assert f'  {told}' in check.show(document).splitlines()


def test_json_to_a_file_and_to_stdout_is_the_same(capsys, bag, tmp_path):
    target = tmp_path / 'out.json'
    status, text, err = run(capsys, 'check', bag, *GIVEN, '--json', str(target))
    assert (status, err) == (0, '')
    assert '0 findings' in text
    status, out, _ = run(capsys, 'check', bag, *GIVEN, '--json', '-')
    assert status == 0
    assert json.loads(out) == json.loads(target.read_text())
    assert json.loads(out)['schema'] == 'escalator_twin/check/1'
    assert [p.name for p in tmp_path.iterdir()] == ['out.json']


def test_json_holds_no_nan():
    document = {
        'a': math.nan,
        'b': [math.inf, np.float64(1.5), np.int64(3), np.bool_(True)],
        'c': np.array([1.0, np.nan]),
        'd': (1, 'x', None, Path('p')),
    }
    assert json.loads(dumps(document)) == {
        'a': None,
        'b': [None, 1.5, 3, True],
        'c': [1.0, None],
        'd': [1, 'x', None, 'p'],
    }
    assert plain(np.float32(0.5)) == 0.5


def test_a_place_for_json_is_checked_before_the_work(capsys, tmp_path):
    for target in (tmp_path / 'no' / 'out.json', tmp_path):
        status, _, err = run(capsys, 'check', 'nowhere', '--json', str(target))
        assert status == 2
        assert err.startswith('escalator-twin: --json')


def test_a_file_is_replaced_whole(tmp_path):
    target = tmp_path / 'a.json'
    write_text(str(target), 'first, and long')
    write_text(str(target), 'second')
    assert target.read_text() == 'second'
    with pytest.raises(EscalatorError, match='cannot be written'):
        write_text(str(tmp_path / 'no' / 'a.json'), 'x')


DOCUMENT = {
    'n': 3,
    'text': 'x',
    'nothing': None,
    'recordings': [
        {'channels': {'link_force/left_a': {'r': 0.9}, 'link_force/left_b': {'r': 0.8}}},
        {'channels': {'link_force/left_a': {'r': 0.7}, 'link_force/left_b': {'r': None}}},
    ],
    'effects': [],
}


@pytest.mark.parametrize(
    ('text', 'n_broken'),
    [
        ('n<=3', 0),
        ('n >= 3', 0),
        ('n>=3.5', 1),
        ('recordings.channels.link_force/left_a.r>=0.7', 0),
        ('recordings.channels.link_force/left_a.r>=0.8', 1),
        ('recordings.channels.*.r>=0.75', 2),
        ('recordings.channels.*.r<=1', 1),
        ('nothing<=1e9', 1),
        ('effects.probability>=0.9', 0),
        ('n<=inf', 0),
    ],
)
def test_rules(text, n_broken):
    assert len(Rule.parse(text).broken(DOCUMENT)) == n_broken


@pytest.mark.parametrize(
    ('text', 'reason'),
    [
        ('m<=3', "unknown name 'm' at the top; expected n, text"),
        ('recordings.channel.x<=3', r"unknown name 'channel' in recordings\[0\]"),
        ('n.x<=3', "unknown name 'x' in n; expected nothing below it"),
        ('text<=3', 'text is text, not a number'),
        ('recordings<=3', 'is no single value'),
    ],
)
def test_rules_on_what_is_not_there(text, reason):
    with pytest.raises(EscalatorError, match=reason):
        Rule.parse(text).broken(DOCUMENT)


def test_a_rule_that_is_not_met_is_status_1_after_the_work(capsys, bag, tmp_path):
    target = tmp_path / 'out.json'
    words = ['check', bag, *GIVEN, '--json', str(target), '--require']
    assert run(capsys, *words, 'clock.offset_s<=0.7')[0] == 0
    status, _, err = run(capsys, *words, 'clock.offset_s<=0.5', '--require', 'clock.drift_ppm>=0')
    assert status == 1
    assert 'not met: clock.offset_s is 0.' in err
    assert err.endswith('required <= 0.5\n')
    assert one_line(err)
    assert target.is_file()
    status, _, err = run(capsys, *words, 'clock.offset<=0.5')
    assert status == 2
    assert "unknown name 'offset' in clock" in err
