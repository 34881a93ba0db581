"""The page in a real browser: it draws all plots and leaves its console empty."""

import re
import shutil
import subprocess

import pytest
from report_samples import campaign, CHANNELS, check, comparison, diagnosis, recording

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


def test_campaign_leaves_the_console_empty(tmp_path):
    page = tmp_path / 'page.html'
    build([campaign()], page)
    dom, console = open_page(page, tmp_path)
    assert console == []
    assert dom.count('<details class="recording"') == 16
