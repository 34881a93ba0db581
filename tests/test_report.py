"""The page: what it tells, that it takes any document, and that it needs nothing from outside."""

import base64
import copy
import hashlib
from html.parser import HTMLParser
import json
import re

import pytest
from report_samples import (
    campaign,
    CHANNELS,
    check,
    comparison,
    diagnosis,
    joint_diagnosis,
    recording,
)

from escalator_twin.cli.diagnose import show
from escalator_twin.errors import EscalatorError
from escalator_twin.report import build

pytestmark = pytest.mark.issue(5)

HOSTILE = '</script><script>alert(1)</script><img src=x onerror=alert(2)>"\'&'
JUNK = (None, HOSTILE, -1.5, True, [], {}, [1, 'a'], [{'a': 1}], float('nan'), 1e300)
VOID = {'meta', 'link', 'input', 'br', 'img'}


class Reader(HTMLParser):
    """Collects elements, their attributes, and text outside scripts and styles."""

    def __init__(self, html):
        super().__init__()
        self.elements, self.open, self.words, self.scripts = [], [], [], []
        self.feed(html)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] == 'script':
            self.scripts.append(data)
        elif not self.open or self.open[-1] != 'style':
            self.words.append(data)

    @property
    def text(self):
        return ' '.join(' '.join(self.words).replace('\u202f', ' ').split())


def make(tmp_path, *documents, names=()):
    out = tmp_path / 'page.html'
    build(documents, out, names)
    html = out.read_text(encoding='utf-8')
    reader = Reader(html)
    assert not reader.open
    return html, reader


def test_comparison_shows_every_score_beside_its_ceiling(tmp_path):
    _, page = make(tmp_path, comparison())
    for channel in CHANNELS:
        numbers = '0.9876 0.9991 0.9912 12.3 % −4.2 ms 0.8000 0.9500 84.2 % 31.0 %'
        assert f'{channel} {numbers}' in page.text
    for told in ('0.48765', '0.48750 to 0.48780', '−2.47 %', '3.703 m', '+0.6031 s', '+21.8'):
        assert told in page.text


def test_every_metric_is_explained(tmp_path):
    _, page = make(tmp_path, comparison())
    for title in ('r in time', 'r of spectra', 'NRMSE', 'Lag', 'r of ripple', 'Ceiling of ripple'):
        assert ('dt', {}) in page.elements
        assert f' {title} ' in page.text


def test_every_channel_is_drawn_without_scripts(tmp_path):
    html, page = make(tmp_path, comparison())
    stills = [e for e in page.elements if e[0] == 'svg' and e[1].get('class') == 'still']
    assert len(stills) == 2 * len(CHANNELS)  # overlay and spectrum
    for name in ('measured', 'simulated', 'residual'):
        assert html.count(f'<path class="{name}"') >= len(CHANNELS)


def test_page_loads_nothing_and_runs_its_own_script_only(tmp_path):
    html, page = make(tmp_path, comparison(), diagnosis(), check())
    for tag, attributes in page.elements:
        for key in ('src', 'href', 'data', 'action', 'poster', 'srcset'):
            assert attributes.get(key, '#').startswith(('#', 'data:,')), (tag, attributes)
        assert not [key for key in attributes if key.startswith('on')]
    assert not re.search(r'@import|url\((?!#)|fetch\(|XMLHttpRequest|import\(', html)
    assert set(re.findall(r'https?://[^\s"\'<]+', html)) <= {'http://www.w3.org/2000/svg'}
    policy = next(a['content'] for t, a in page.elements if a.get('http-equiv'))
    digest = hashlib.sha256(page.scripts[-1].encode()).digest()
    assert policy.startswith("default-src 'none'; ")
    assert f"script-src 'sha256-{base64.b64encode(digest).decode()}'" in policy


def test_hostile_text_stays_text(tmp_path):
    part = recording(HOSTILE, f'/bags/{HOSTILE}')
    part['channels'][HOSTILE] = part['channels'][CHANNELS[0]]
    part['overlay']['channels'][HOSTILE] = part['overlay']['channels'][CHANNELS[0]]
    part['quality'] = [{'kind': HOSTILE, 'channel': HOSTILE, 'from_s': 1, 'detail': HOSTILE}]
    told = diagnosis(part)
    told['effects'][0] |= {'cause': HOSTILE, 'alternatives': [HOSTILE], HOSTILE: HOSTILE}
    told['unexplained']['signature'] = {HOSTILE: HOSTILE}
    checked = check() | {'path': HOSTILE, 'topics': [{'topic': HOSTILE, 'type': HOSTILE}]}
    _, page = make(tmp_path, told, checked, names=[HOSTILE, HOSTILE])
    tags = [tag for tag, _ in page.elements]
    assert 'img' not in tags
    assert tags.count('script') == 3  # overlays, spectra, and the page's own
    assert page.text.count('onerror=alert(2)') > 10
    for script in page.scripts[:-1]:
        assert HOSTILE in [panel['channel'] for panel in json.loads(script)['panels']]


def test_diagnosis_is_told_in_full(tmp_path):
    _, page = make(tmp_path, diagnosis())
    for told in (
        'roller drag axle 44, left side',
        '118.4 N',
        '112.9 to 123.8',
        '97.3 %',
        'guide drag',
        'guide step s = 13.27 m, both sides',
        'for: once per loop',
        'against: silent in link b',
        'later passages (12 blocks)',
        '14.0 % 3.1 % 412 22.3',
        '3.40 % of the whitened residual energy',
        'locked to guide',
        'out/extended.yaml',
    ):
        assert told in page.text, told


def test_diagnosis_without_causes_or_second_look_says_so(tmp_path):
    told = diagnosis() | {'effects': [], 'unexplained': {'significant': False, 'share': 0.0}}
    told['gain'] = {'held_out': None, 'split': 'one passage only'}
    _, page = make(tmp_path, told)
    assert 'No cause is named: the machine and its instruments are within tolerance' in page.text
    assert 'no gain on held-out data: one passage only' in page.text


@pytest.mark.parametrize('is_named', [True, False])
def test_a_gain_of_what_is_not_named_is_told_as_such(tmp_path, is_named):
    told = diagnosis(recording() | {'place_is_certain': True})
    told |= {} if is_named else {'effects': []}
    _, page = make(tmp_path, told)
    sentence = 'Nothing is named: the gain is that of what was found and is not believed.'
    assert (sentence in page.text) is not is_named
    line = 'gain held out: later passages'
    assert (line in show(told)) is is_named
    other = 'gain held out, of what was found and is not named: later passages'
    assert (other in show(told)) is not is_named


@pytest.mark.issue(7)
def test_gain_tells_its_interval_and_what_became_worse(tmp_path):
    _, page = make(tmp_path, joint_diagnosis())
    for told in (
        'falls by 89.4 % to 92.5 % (95 %, bootstrap over the blocks): significant.',
        f'Worse by more than 2 %: {CHANNELS[2]}.',
    ):
        assert told in page.text, told


@pytest.mark.issue(7)
def test_extended_machine_is_there_with_the_way_back(tmp_path):
    html, page = make(tmp_path, joint_diagnosis())
    case = '--case speed=0.5,direction=up --duration 60'
    assert f'simulate --machine out/extended.yaml {case}' in page.text
    assert f'simulate --machine config/machines/prototype.yaml {case}' in page.text
    assert 'extends: prototype.yaml\ndeviations:\n- cause: roller_drag</pre>' in html
    _, page = make(tmp_path, diagnosis())
    assert 'The document does not hold the description itself' in page.text


@pytest.mark.issue(7)
def test_recordings_of_one_diagnosis_are_told_one_by_one(tmp_path):
    html, page = make(tmp_path, joint_diagnosis())
    part = html.split('id="by-recording"')[1].split('</section>')[0]
    words = Reader(part).text
    told = 'low_up_empty_lo roller drag axle 44, left side force 118.4 (112.9 to 123.8) N 97.3 %'
    assert told in words
    assert '3.40 %' in words
    assert f'{CHANNELS[0]} 412 to 22.3, significant' in words
    assert 'high_down_full_hi none no –' in words
    assert 'From 2 recordings of one machine together' in page.text
    _, page = make(tmp_path, diagnosis())
    assert 'Recordings one by one' not in page.text


@pytest.mark.issue(7)
def test_in_how_many_recordings_a_cause_shows_is_one_sentence(tmp_path):
    told = joint_diagnosis()
    told['effects'][0] |= {'recordings': 15, 'of': 16}
    told['seconds'] = 394.6
    html, page = make(tmp_path, told)
    assert '15 of 16 recordings show it.' in page.text
    assert 'took 395 s' in page.text
    assert not re.search(r'<h4>(Recordings|Of|Seconds)</h4>', html)


def test_what_has_no_place_is_not_called_good(tmp_path):
    told = diagnosis(recording(place_is_certain=False))
    told |= {'effects': [], 'unexplained': {'significant': False, 'share': 0.0, 'signature': {}}}
    html, page = make(tmp_path, told)
    assert 'within tolerance' not in page.text
    assert 'Not judged, since the place in the loop is not certain: low_up_empty_lo.' in page.text
    assert 'Not judged: the place in the loop is not certain.' in page.text
    words = Reader(html.split('<dl class="tiles">')[1].split('</dl>')[0]).text
    assert 'not judged' in words


def test_of_two_recordings_the_one_without_a_place_is_told(tmp_path):
    told = joint_diagnosis()
    told['recordings'][1]['place_is_certain'] = False
    _, page = make(tmp_path, told)
    assert page.text.count('not judged') == 1
    assert 'Not judged, since the place in the loop is not certain' in page.text


@pytest.mark.parametrize('is_unexplained', [False, True])
def test_the_summary_calls_good_only_what_leaves_nothing_open(tmp_path, is_unexplained):
    told = diagnosis()
    told['effects'] = []
    told['unexplained']['significant'] = is_unexplained
    html, _ = make(tmp_path, told)
    words = Reader(html.split('<dl class="tiles">')[1].split('</dl>')[0]).text
    assert ('within tolerance' in words) == (not is_unexplained)
    assert ('something stays unexplained' in words) == is_unexplained


@pytest.mark.issue(7)
@pytest.mark.parametrize('notes', ['', 'synthetic, from a generator'])
def test_where_the_data_come_from_is_said_or_left_to_their_maker(tmp_path, notes):
    _, page = make(tmp_path, diagnosis(recording(notes=notes)))
    assert ('is for their maker to state' in page.text) == (notes == '')
    assert ('These data are synthetic' in page.text) == (notes != '')


def test_extended_twin_is_drawn_with_its_residual(tmp_path):
    told = diagnosis()
    columns = told['recordings'][0]['overlay']['channels'][CHANNELS[1]]
    columns['extended'] = columns['measured']
    html, page = make(tmp_path, told)
    assert 'measured − extended twin' in page.text
    assert '<path class="extended"' in html
    assert '<path class="residual-after"' in html


def test_check_is_told_in_full(tmp_path):
    html, page = make(tmp_path, check())
    for told in (
        '/measured/a x/msg/A',
        '200.0 Hz',
        'missing',
        'offset −0.9372 s (−0.9373 to −0.9371)',
        'data gap link_force/left_a 40.00 s 44.00 s 4.00 s without samples',
        'preload 3000 N',
    ):
        assert told in page.text, told
    assert '<title>data gap, 40.00\u202fs to 44.00\u202fs</title>' in html


def test_findings_stand_on_the_whole_recordings_axis(tmp_path):
    finding = {'kind': 'data_gap', 'channel': CHANNELS[0], 'from_s': 1.0, 'to_s': 2.0}
    html, _ = make(tmp_path, comparison(recording(quality=[finding])))
    chart = html.split('findings over time', 1)[1].split('</svg>', 1)[0]
    marks = [float(m) for m in re.findall(r'<text class="x"[^>]*>([0-9.]+)<', chart)]
    assert marks[-1] == 15.0  # s: the next one, 20 s, is past the last sample


def test_recording_of_two_documents_is_told_once(tmp_path):
    _, page = make(tmp_path, comparison(), diagnosis())
    chapters = [a for t, a in page.elements if t == 'details' and a.get('class') == 'recording']
    assert len(chapters) == 1
    other = recording()
    other['channels'][CHANNELS[0]]['r_time'] = 0.5
    _, page = make(tmp_path, comparison(), diagnosis(other))
    chapters = [a for t, a in page.elements if t == 'details' and a.get('class') == 'recording']
    assert len({a['id'] for a in chapters}) == 2


def test_campaign_shows_effects_of_factors_and_published_means(tmp_path):
    _, page = make(tmp_path, campaign())
    table = page.text.split('Agreement by factor', 2)[2].split('r in time', 1)[0]
    assert 'empty / full' in table
    assert 'lo / hi' in table
    found = table.split(CHANNELS[0], 1)[1]
    speed, way, load, preload = re.findall(r'(● )?([+−]?\d+\.\d+) % \S+ % → \S+ %', found)[:4]
    assert speed[0]
    assert float(speed[1].replace('−', '-')) == pytest.approx(-10.0, abs=0.3)
    assert load[0]
    assert float(load[1]) == pytest.approx(20.0, abs=0.3)
    assert float(way[1].replace('−', '-')) == pytest.approx(0.0, abs=0.3)
    assert float(preload[1].replace('−', '-')) == pytest.approx(0.0, abs=0.3)
    assert 'chain force, r in time, 2 Hz over 0.85 0.9876' in page.text
    assert 'step acceleration, r in time, 0.2 Hz 0.80 not in the documents' in page.text


@pytest.mark.parametrize(
    ('told', 'is_said'),
    [({}, False), ({'notes': 'made on a virtual rig'}, True), ({'notes': 'Tuesday'}, False)],
)
def test_synthetic_data_are_named_where_the_recording_says_so(tmp_path, told, is_said):
    _, page = make(tmp_path, comparison(recording(**told)))
    assert ('These data are synthetic' in page.text) == is_said


def test_nan_is_a_missing_value(tmp_path):
    part = recording()
    part['channels'][CHANNELS[0]] |= {'r_time': float('nan'), 'ripple_ceiling': float('inf')}
    part['overlay']['channels'][CHANNELS[0]]['measured'][7] = float('nan')
    _, page = make(tmp_path, comparison(part))
    assert f'{CHANNELS[0]} – 0.9991 0.9912' in page.text
    assert not re.search(r'\b(nan|inf)\b', page.text, re.IGNORECASE)
    for script in page.scripts[:-1]:
        assert 'NaN' not in script


@pytest.mark.parametrize(
    ('document', 'message'),
    [
        ({'schema': 'other/1'}, r'a\.json: schema: expected one of .*compare/1.*, found .other/1'),
        ([1], r'a\.json: schema: expected one of .*, found None'),
        ({'schema': 'escalator_twin/compare/2', 'recordings': []}, r'found .*compare/2'),
        ({'schema': 'escalator_twin/compare/1'}, r'a\.json: recordings: expected a list'),
        (comparison(4), r'a\.json: recordings\[0\]: expected an object, found int'),
        (
            comparison({'path': 'x'}),
            r'recordings\[0\]: channels: expected an object, found nothing',
        ),
        (comparison({'channels': {'a': 3}}), r'channels\.a: expected an object, found int'),
    ],
)
def test_foreign_document_is_refused_by_name(tmp_path, document, message):
    with pytest.raises(EscalatorError, match=message):
        build([document], tmp_path / 'page.html', ['a.json'])
    assert not list(tmp_path.iterdir())


def test_page_that_cannot_be_written_is_an_error(tmp_path):
    with pytest.raises(EscalatorError, match='cannot be written'):
        build([check()], tmp_path / 'none' / 'page.html')


def paths(value, here=()):
    """Return the ways to all parts of a document, of a list to its first item only."""
    if here:
        yield here
    if isinstance(value, dict | list):
        items = value.items() if isinstance(value, dict) else enumerate(value[:1])
        for key, item in items:
            yield from paths(item, (*here, key))


def break_at(document, path, junk):
    broken = copy.deepcopy(document)
    target = broken
    for key in path[:-1]:
        target = target[key]
    target[path[-1]] = junk
    return broken


@pytest.mark.parametrize('kind', [comparison, diagnosis, joint_diagnosis, check])
def test_any_part_may_be_wrong(tmp_path, kind):
    """Any junk in a document of a known schema makes a page, or an error that says where."""
    document = kind()
    for part in document.get('recordings', ()):
        part['channels'] = {CHANNELS[0]: part['channels'][CHANNELS[0]]}
        columns = {k: v[:40] for k, v in part['overlay']['channels'][CHANNELS[0]].items()}
        part['overlay']['channels'] = {CHANNELS[0]: columns}
    errors = set()
    for i, path in enumerate(paths(document)):
        try:
            build([break_at(document, path, JUNK[i % len(JUNK)])], tmp_path / 'page.html')
        except EscalatorError as error:
            errors.add(re.split(': ', str(error))[1])
    assert errors <= {
        'schema',
        'recordings',
        'recordings[0]',
        f'recordings[0].channels.{CHANNELS[0]}',
    }
