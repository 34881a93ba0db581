"""The case that simulate is given, in a row or in a file."""

import pytest
from shells import bag_in, GIVEN, MACHINE, run

from escalator_twin.case import parse_case
from escalator_twin.errors import ExperimentError

pytestmark = pytest.mark.issue(2)


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    return bag_in(tmp_path_factory.mktemp('cli'))


def test_a_case_in_a_row():
    experiment = parse_case('speed=0.25, direction=down ,load=75,preload=6000', MACHINE)
    assert experiment.set_speed_m_s == 0.25
    assert experiment.direction == -1
    assert experiment.load_per_step_kg == (75.0,)
    assert experiment.preload_n == 6000.0


def test_what_a_case_leaves_open_is_the_machines():
    default = MACHINE.default_experiment()
    assert parse_case(None, MACHINE) == default
    assert parse_case('load=10', MACHINE).set_speed_m_s == default.set_speed_m_s


def test_a_case_in_a_file(tmp_path):
    path = tmp_path / 'case.yaml'
    path.write_text(f'speed: 0.5\ndirection: UP\nload: {[0.0] * 30 + [75] * 30}\n')
    experiment = parse_case(str(path), MACHINE)
    assert experiment.load_per_step_kg == (0.0,) * 30 + (75.0,) * 30
    assert experiment.direction == 1


@pytest.mark.parametrize(
    ('text', 'reason'),
    [
        ('sped=1', '--case: sped: unknown key; expected one of speed, direction, load, preload'),
        ('speed=fast', "--case: speed: expected a number, found 'fast'"),
        ('speed=nan', "speed: expected a number, found 'nan'"),
        ('speed=-1', r'speed: expected a value in \(0, 10\) m/s, found -1.0'),
        ('direction=left', "direction: expected up or down, found 'left'"),
        ('load=-5', 'load: expected one or more values >= 0 kg'),
        ('preload=1e9', 'preload: expected 0 to 1e6 N'),
        ('speed=1,speed=2', 'speed: given twice'),
        ('speed=1,load', "expected key=value, found 'load'"),
        ('nowhere.yaml', 'nowhere.yaml: cannot be read'),
    ],
)
def test_wrong_cases_name_the_key(text, reason):
    with pytest.raises(ExperimentError, match=reason):
        parse_case(text, MACHINE)


@pytest.mark.parametrize(
    ('text', 'reason'),
    [
        ('load: [1, 2]', 'expected one value or one for each of 60 steps, found 2'),
        ('load: [1, x]', r"load\[1\]: expected a number, found 'x'"),
        ('speed: true', 'speed: expected a number, found True'),
        ('[1]', 'expected the keys speed'),
        ('a: [', 'not YAML'),
        ('3: 4', '3: unknown key'),
    ],
)
def test_wrong_case_files_name_file_and_key(tmp_path, text, reason):
    path = tmp_path / 'case.yaml'
    path.write_text(text)
    with pytest.raises(ExperimentError, match=reason) as caught:
        parse_case(str(path), MACHINE)
    assert str(path) in str(caught.value)


def test_simulate_refuses_before_it_works(capsys, bag):
    status, _, err = run(capsys, 'simulate', '--duration', '1', '--out', bag, *GIVEN)
    assert status == 2
    assert 'nothing is overwritten' in err
