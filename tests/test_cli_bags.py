"""What check, compare and diagnose say of bags that lack something, and report of documents."""

import json
from pathlib import Path

from makers import (
    mcap_bytes,
    Raw,
    strain_messages,
    synthetic,
    write_mcap,
)
from mcap.writer import CompressionType
import numpy as np
import pytest
from shells import bag_in, GIVEN, MACHINE, one_line, run

from escalator_twin import bagfile
from escalator_twin.cli import check as check_verb
from escalator_twin.cli import options
from escalator_twin.cli.output import dumps
from escalator_twin.suggest import suggest

pytestmark = pytest.mark.issue(2)


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    return bag_in(tmp_path_factory.mktemp('cli'))


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
