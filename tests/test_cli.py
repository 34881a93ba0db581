"""The shell of the command line: verbs, exit codes, one line for a mistake, progress."""

import io
from pathlib import Path
import sys

from makers import (
    ROOT,
)
import pytest
from shells import bag_in, GIVEN, one_line, run

from escalator_twin import __version__
from escalator_twin.cli import check as check_verb
from escalator_twin.cli import main as shell
from escalator_twin.cli.main import main
from escalator_twin.cli.options import machine_path
from escalator_twin.cli.progress import ProgressLine

pytestmark = pytest.mark.issue(2)


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    return bag_in(tmp_path_factory.mktemp('cli'))


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
