"""The page in a real browser: it draws all plots and leaves its console empty."""

import json
import math
import re
import shutil
import subprocess

import pytest
from report_samples import (
    campaign,
    CHANNELS,
    check,
    comparison,
    diagnosis,
    joint_diagnosis,
    PITCH_M,
    recording,
)

from escalator_twin.report import build

CHROMIUM = shutil.which('chromium') or shutil.which('chromium-browser')
FLAGS = (
    '--headless',
    '--no-sandbox',
    '--disable-gpu',
    '--disable-quic',
    '--disable-background-networking',
    '--disable-component-update',
    '--disable-dev-shm-usage',
    '--disable-sync',
    '--no-first-run',
    '--enable-logging=stderr',
    '--v=0',
    '--window-size=1280,1000',
)

pytestmark = [
    pytest.mark.issue(5),
    pytest.mark.skipif(CHROMIUM is None, reason='chromium is not installed'),
]


def open_page(path, tmp_path):
    """Return the document after its scripts have run, and what its console says."""
    done = subprocess.run(
        [CHROMIUM, *FLAGS, f'--user-data-dir={tmp_path / "user"}', '--dump-dom', path.as_uri()],
        capture_output=True,
        text=True,
        timeout=120,
        check=True,
    )
    return done.stdout, re.findall(r'.*CONSOLE.*', done.stderr)


def test_console_would_tell_of_an_error(tmp_path):
    page = tmp_path / 'page.html'
    page.write_text('<script>throw new Error("seen")</script>', encoding='utf-8')
    _, console = open_page(page, tmp_path)
    assert any('seen' in line for line in console)


def test_all_plots_are_drawn_and_the_console_stays_empty(tmp_path):
    page = tmp_path / 'page.html'
    hostile = recording('</script><b>"x', '/bags/two')
    build([comparison(recording(), hostile), diagnosis(), check()], page)
    dom, console = open_page(page, tmp_path)
    assert console == []
    drawn = re.findall(r'<div class="stack"[^>]*data-drawn="(\d+)"', dom)
    assert drawn == [str(len(CHANNELS))]  # the first recording's overlays; the rest when opened
    live = dom.split('data-drawn', 1)[1].split('class="stack"', 1)[0]
    for name in ('measured', 'simulated', 'residual'):
        paths = re.findall(rf'<path class="{name}" d="(M[^"]+)"', live)
        assert len(paths) == len(CHANNELS)
        assert all(len(path) > 1000 and 'NaN' not in path for path in paths)
    # a gap in the measurement breaks its line
    assert re.search(r'<path class="measured" d="M[^"M]+M', live)


ACTIONS = """<script>
const stack = document.querySelector('.stack');
const plots = [...stack.querySelectorAll('.plot')];
const told = { ticks: [], readouts: [], whole: [] };
const range = () => plots.map((plot) => {
  const marks = [...plot.querySelectorAll('.ticks text:not(.title)')].map((t) => Number(t.textContent));
  return [Math.min(...marks), Math.max(...marks)];
});
const box = plots[1].getBoundingClientRect();
plots[1].setPointerCapture = () => {};
const point = (type, share) => plots[1].dispatchEvent(new PointerEvent(type, {
  clientX: box.left + 58 + share * (box.width - 66), clientY: box.top + 40, button: 0, pointerId: 1 }));
point('pointerdown', 0.4); point('pointermove', 0.5); point('pointerup', 0.6);
told.ticks = range();
point('pointermove', 0.5);
told.readouts = [...stack.querySelectorAll('.readout')].map((r) => r.textContent);
plots[0].dispatchEvent(new KeyboardEvent('keydown', { key: 'Escape', bubbles: true }));
told.whole = range();
stack.querySelector('input[value=simulated]').click();
told.simulated = stack.querySelectorAll('path.simulated').length;
stack.querySelector('input[value=place]').click();
told.breaks = plots[1].querySelector('path.measured').getAttribute('d').split('M').length - 1;
document.querySelectorAll('[data-open=all]').forEach((button) => button.click());
document.title = JSON.stringify(told);
</script></body>"""


def test_plots_are_zoomed_and_read_together(tmp_path):
    page = tmp_path / 'page.html'
    build([comparison()], page)
    html = re.sub(r'<meta http-equiv.*?>', '', page.read_text(encoding='utf-8'))
    page.write_text(html.replace('</body>', ACTIONS), encoding='utf-8')
    dom, console = open_page(page, tmp_path)
    assert console == []
    told = json.loads(re.search(r'<title>(.*?)</title>', dom).group(1))
    # 10 m of travel: 4 m to 6 m were chosen in one of three panels
    for low, high in told['ticks']:
        assert (low, high) == (pytest.approx(4.0, abs=0.25), pytest.approx(6.0, abs=0.25))
    for low, high in told['whole']:
        assert (low, high) == (pytest.approx(0.0, abs=1.0), pytest.approx(10.0, abs=1.0))
    amplitudes = (1.0, 100.0, 10.0)  # kN, m, m/s2
    for scale, readout in zip(amplitudes, told['readouts'], strict=True):
        found = re.fullmatch(
            r'travel (\S+) m · measured (\S+) · simulated (\S+) · measured − simulated \S+ .*',
            readout,
        )
        travel, measured, simulated = (float(v.replace('−', '-')) for v in found.groups())
        assert travel == pytest.approx(5.0, abs=0.05)
        wave = math.sin(2 * math.pi * travel / PITCH_M)
        assert measured == pytest.approx(scale * 1.1 * wave, abs=0.05 * scale)
        assert simulated == pytest.approx(scale * wave, abs=0.05 * scale)
    assert told['simulated'] == 0
    assert told['breaks'] == 3  # 10 m from 3.7 m downwards, round a loop of 4 m


def test_campaign_leaves_the_console_empty(tmp_path):
    page = tmp_path / 'page.html'
    build([campaign()], page)
    dom, console = open_page(page, tmp_path)
    assert console == []
    assert dom.count('<details class="recording"') == 16


@pytest.mark.issue(7)
def test_diagnosis_of_several_recordings_leaves_the_console_empty(tmp_path):
    page = tmp_path / 'page.html'
    build([joint_diagnosis()], page)
    dom, console = open_page(page, tmp_path)
    assert console == []
    assert dom.count('class="whisker"') == 1
    assert 'aria-label="NRMSE below 20 Hz, before and after"' in dom
