"""The command line: exit codes, one line for a mistake, JSON whole or not at all."""

import io
import json
import math
from pathlib import Path
import sys

from makers import (
    mcap_bytes,
    PROTOTYPE,
    prototype,
    Raw,
    ROOT,
    strain_messages,
    synthetic,
    write_mcap,
)
from mcap.writer import CompressionType
import numpy as np
import pytest

from escalator_twin import __version__, bagfile
from escalator_twin.cli import check as check_verb
from escalator_twin.cli import main as shell
from escalator_twin.cli import options
from escalator_twin.cli.case import parse_case
from escalator_twin.cli.main import main
from escalator_twin.cli.options import machine_path
from escalator_twin.cli.output import dumps, plain, Rule, write_text
from escalator_twin.cli.progress import ProgressLine
from escalator_twin.errors import EscalatorError, ExperimentError
from escalator_twin.suggest import suggest

pytestmark = pytest.mark.issue(2)

MACHINE = prototype()
GIVEN = ['--machine', str(PROTOTYPE)]


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    path = tmp_path_factory.mktemp('cli') / 'bag'
    bagfile.write(path, synthetic(MACHINE, 10.0), MACHINE, namespace='/measured')
    return str(path)


def run(capsys, *words):
    status = main(list(words))
    out = capsys.readouterr()
    return status, out.out, out.err


def one_line(text):
    return text.count('\n') == 1 and text.endswith('\n')


# the shell


def test_version_and_help(capsys):
    assert run(capsys, '--version') == (0, f'escalator-twin {__version__}\n', '')
    status, out, _ = run(capsys, '--help')
    assert status == 0
    assert all(verb in out for verb in ('check', 'simulate', 'compare', 'diagnose', 'report'))


@pytest.mark.parametrize('verb', ['check', 'simulate', 'compare', 'diagnose', 'report'])
def test_every_verb_takes_the_common_options(capsys, verb):
    status, out, _ = run(capsys, verb, '--help')
    assert status == 0
    assert all(option in out for option in ('--json', '--require', '--seed', '--jobs'))


@pytest.mark.parametrize(
    ('words', 'reason'),
    [
        ([], 'required: VERB'),
        (['walk'], "invalid choice: 'walk'"),
        (['check'], 'required: BAG'),
        (['check', 'x', '--sed', '1'], 'unrecognized arguments: --sed'),
        (['check', 'x', '--jobs', '0'], '1 or more'),
        (['check', 'x', '--seed', '-1'], '0 or more'),
        (['check', 'x', '--seed', 'a'], "invalid seed value: 'a'"),
        (['check', 'x', '--require', 'a=3'], 'NAME<=VALUE'),
        (['check', 'x', '--require', 'a<=b'], 'a<=b'),
        (['check', 'nowhere.mcap'], 'nowhere.mcap: no such file'),
        (['compare', 'nowhere.mcap', '--machine', 'no.yaml'], 'nowhere.mcap: no such file'),
        (['simulate', '--duration', '0', '--out', 'x'], 'above 0'),
        (['simulate', '--duration', '3', '--out', 'x', '--machine', 'no.yaml'], 'no.yaml'),
        (['report', 'no.json', '--out', 'x.html'], 'no.json: cannot be read'),
    ],
    ids=lambda value: ' '.join(value) if isinstance(value, list) else '',
)
def test_bad_input_is_one_line_and_status_2(capsys, words, reason):
    status, out, err = run(capsys, *words)
    assert (status, out) == (2, '')
    assert reason in err
    assert one_line(err)


def test_an_interruption_is_status_130(capsys, monkeypatch, bag, tmp_path):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(check_verb, 'check', interrupted)
    target = tmp_path / 'out.json'
    status, _, err = run(capsys, 'check', bag, *GIVEN, '--json', str(target))
    assert status == 130
    assert err == 'escalator-twin: interrupted\n'
    assert list(tmp_path.iterdir()) == []


def test_a_bug_shows_itself(monkeypatch, bag):
    def broken(*_):
        raise ZeroDivisionError('of ours')

    monkeypatch.setattr(check_verb, 'check', broken)
    with pytest.raises(ZeroDivisionError, match='of ours'):
        main(['check', bag, *GIVEN])


def test_verbs_are_imported_when_asked_for():
    assert set(shell.VERBS) == {'check', 'simulate', 'compare', 'diagnose', 'report'}
    for name in shell.VERBS:
        assert (Path(shell.__file__).parent / f'{name}.py').is_file()


# JSON and rules


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


# check


def test_check_tells_what_is_there_and_what_is_missing(capsys, tmp_path):
    path = write_mcap(tmp_path / 'a.mcap', strain_messages(400))
    status, out, _ = run(capsys, 'check', str(path), *GIVEN, '--json', '-')
    document = json.loads(out)
    assert status == 0
    rows = {row['topic']: row for row in document['topics']}
    assert rows['/measured/link/left_a/strain'] == {
        'topic': '/measured/link/left_a/strain',
        'type': 'escalator_msgs/msg/LinkStrain',
        'found': True,
        'expected': True,
        'channels': ['link_force/left_a'],
        'n_messages': 400,
        'rate_hz': pytest.approx(200.0),
        'first_s': 0.0,
        'last_s': pytest.approx(1.995),
        'serialization': 'cdr',
    }
    missing = {name for name, row in rows.items() if not row['found']}
    assert '/measured/step/acceleration' in missing
    assert len(missing) == 6
    assert document['clock']['offset_s'] is None
    assert document['clock']['reason'] == 'no messages of the logger ground'
    assert {q['kind'] for q in document['quality']} == {'missing_topic'}


def test_check_of_a_cut_recording_is_status_0(capsys, bag, tmp_path):
    (source,) = Path(bag).glob('*.mcap')
    cut = tmp_path / 'cut.mcap'
    cut.write_bytes(source.read_bytes()[: source.stat().st_size // 2])
    status, out, _ = run(capsys, 'check', str(cut), *GIVEN)
    assert status == 0
    assert 'cut off at byte' in out
    assert 'data_gap' in out


def test_check_as_text_names_the_findings(capsys, tmp_path):
    recording = synthetic(MACHINE, 10.0)
    del recording.signals['tensioner/displacement']
    bagfile.write(tmp_path / 'bag', recording, MACHINE, namespace='/measured')
    _, out, _ = run(capsys, 'check', str(tmp_path / 'bag'), *GIVEN)
    assert 'clock: unknown: no messages of the logger ground' in out
    assert 'missing_topic tensioner/displacement' in out
    assert '(missing)' in out


def test_check_and_its_draft_bear_any_damage(bag, tmp_path):
    """Numbers of any size in any place, which no checksum guards."""
    rows = [Raw(m.topic, m.type, m.bag_ns, m.data) for m in bagfile.messages(bag)][:4000]
    options = {'compression': CompressionType.NONE, 'enable_crcs': False, 'chunk_size': 20000}
    original = mcap_bytes(rows, **options)
    path = tmp_path / 'a.mcap'
    rng = np.random.default_rng(7)
    for _ in range(25):
        data = bytearray(original)
        for at in rng.integers(100, len(data) - 100, 60):
            data[at : at + 8] = rng.bytes(8)
        path.write_bytes(data)
        document = json.loads(dumps(check_verb.check(path, MACHINE)))
        assert document['schema'] == 'escalator_twin/check/1'
        assert 'instruments:' in suggest(path)


# what compare and diagnose need


@pytest.mark.parametrize('verb', ['compare', 'diagnose'])
def test_recordings_without_the_needed_topics_are_refused(capsys, tmp_path, verb):
    path = write_mcap(tmp_path / 'a.mcap', strain_messages(5, topic='/other/strain'))
    status, _, err = run(capsys, verb, str(path), *GIVEN)
    assert status == 2
    assert one_line(err)
    assert str(path) in err
    assert '/measured/link/left_a/strain' in err
    assert '/other/strain' in err


@pytest.mark.parametrize('verb', ['compare', 'diagnose', 'check'])
def test_what_is_no_bag_is_refused(capsys, tmp_path, verb):
    (tmp_path / 'empty.mcap').write_bytes(b'')
    (tmp_path / 'text.mcap').write_text('text')
    (tmp_path / 'folder').mkdir()
    for name in ('empty.mcap', 'text.mcap', 'folder', 'nowhere'):
        status, out, err = run(capsys, verb, str(tmp_path / name), *GIVEN)
        assert (status, out) == (2, '')
        assert one_line(err)
        assert name in err


def test_the_bag_comes_before_the_machine(capsys, tmp_path):
    for verb in ('check', 'compare', 'diagnose'):
        _, _, err = run(capsys, verb, str(tmp_path / 'nowhere'), '--machine', 'no.yaml')
        assert 'nowhere: no such file' in err


@pytest.mark.shared
def test_other_peoples_bags(capsys, shared, monkeypatch):
    """check: 0 where the container can be read, 2 otherwise; compare and diagnose: 2."""
    for module in (options, check_verb):  # parsed once, for speed
        monkeypatch.setattr(module, 'load_machine', lambda _: MACHINE)
    readable = 0
    for path in sorted((shared / 'foreign_bags').rglob('*')):
        is_bag = (
            path.suffix in ('.mcap', '.db3') or any(path.glob('*.mcap')) or any(path.glob('*.db3'))
        )
        status, _, err = run(capsys, 'check', str(path), *GIVEN)
        assert status == (0 if is_bag else 2), path
        assert is_bag or one_line(err)
        readable += is_bag
        for verb in ('compare', 'diagnose'):
            status, out, err = run(capsys, verb, str(path), *GIVEN)
            assert (status, out) == (2, ''), path
            assert one_line(err), path
            assert str(path) in err
    assert readable > 455


# the case of simulate


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


# report


@pytest.mark.parametrize(
    ('text', 'reason'),
    [
        ('{', 'not JSON'),
        ('[1]', 'schema: expected one of escalator_twin/check/1'),
        ('{"schema": "other/1"}', "found 'other/1'"),
    ],
)
def test_report_refuses_other_documents(capsys, tmp_path, text, reason):
    path = tmp_path / 'in.json'
    path.write_text(text)
    status, _, err = run(capsys, 'report', str(path), '--out', str(tmp_path / 'out.html'))
    assert status == 2
    assert reason in err
    assert one_line(err)


# odds and ends


def test_the_default_machine_is_found_from_anywhere(monkeypatch, tmp_path):
    monkeypatch.chdir(ROOT)
    assert machine_path('config/machines/prototype.yaml') == Path('config/machines/prototype.yaml')
    monkeypatch.chdir(tmp_path)
    found = machine_path('config/machines/prototype.yaml')
    assert found.is_file()
    assert found.is_absolute()
    assert machine_path('no.yaml') == Path('no.yaml')


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_progress_on_a_terminal_only():
    times = iter([0.0, 0.01, 0.5, 0.6])
    terminal = Terminal()
    with ProgressLine(terminal, lambda: next(times)) as progress:
        progress(0.0, 10.0)
        progress(1.0, 10.0)  # too soon after the last
        progress(5.0, 10.0)
        progress(10.0, 10.0)
    drawn = terminal.getvalue().split('\r\x1b[K')
    assert drawn[1:] == [
        '[' + '-' * 30 + ']   0 %',
        '[' + '#' * 15 + '-' * 15 + ']  50 %',
        '[' + '#' * 30 + '] 100 %',
        '',
    ]
    silent = io.StringIO()
    with ProgressLine(silent) as progress:
        progress(1.0)
    assert silent.getvalue() == ''


def test_the_process_has_the_same_exit_codes(tmp_path):
    import subprocess

    done = subprocess.run(
        [sys.executable, '-m', 'escalator_twin.cli.main', 'check', str(tmp_path / 'nowhere')],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert one_line(done.stderr)
