"""The second machine's recordings by other means: what is in them, and that the twin reads them."""

import ast
from pathlib import Path

from belt.chain import Chain, read_sheet
from belt.recording import make_recording
from belt.rope import balance
import kwons
import numpy as np
import pytest

from escalator_twin import bagfile, pipeline

pytestmark = pytest.mark.issue(8)

FILE = kwons.MACHINES / 'kwon.yaml'
SHEET = read_sheet(FILE)
PITCH_S = 0.40638 / 0.5
AGREEMENT = {
    'step/acceleration/x': 0.99,
    'step/acceleration/z': 0.99,
    'tensioner/displacement': 0.99,
    'roller/reaction': 0.95,
    'gear/torque': 0.85,
    'chain/tension': 0.85,
}
FOLDER = Path(__file__).parent / 'belt'


def test_it_imports_nothing_of_the_twin():
    for path in FOLDER.glob('*.py'):
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
            names = [a.name for a in getattr(node, 'names', ())] + [getattr(node, 'module', '')]
            if isinstance(node, ast.Import | ast.ImportFrom):
                assert not any('escalator' in (name or '') for name in names), path


def rows(**hidden):
    return Chain(SHEET, hidden).drive(3.0, 2.0 * PITCH_S)


def test_causes_show_where_they_should():
    plain = rows()
    assert (plain[-1, 0] - plain[0, 0]) / (2.0 * PITCH_S) == pytest.approx(0.5, rel=0.01)
    torque = plain[:, 5].mean()
    assert rows(rolling_resistance=1.6)[:, 5].mean() > 1.25 * torque
    assert rows(roller_drag=120.0, roller_drag_axle=7)[:, 5].mean() - torque == pytest.approx(
        120.0 * 5 * 0.40638 / (2.0 * np.pi), rel=0.15
    )
    slack = rows(tensioner_preload=1.25)[:, 3].mean() - plain[:, 3].mean()
    assert slack == pytest.approx(500.0, rel=0.15)
    longer = rows(chain_elongation=1e-4)[:, 2].mean() - plain[:, 2].mean()
    assert longer == pytest.approx(29e-4, rel=0.15)
    assert np.abs(rows(gear_eccentricity=2e-3) - plain)[:, 0].max() > 5e-4
    assert balance(SHEET, 150.0)[1] - balance(SHEET)[1] == pytest.approx(150.0 * 0.35, rel=0.25)


def test_the_twin_reads_what_it_writes(tmp_path):
    make_recording(tmp_path / 'bag', SHEET, 3.0, 2.0, 5, {'gauge_gain': 1.09})
    recording = bagfile.read(tmp_path / 'bag', kwons.kwon())
    assert set(recording.signals) == {s.channel for s in kwons.kwon().instruments.sensors}
    assert recording.experiment.preload_n == 4000.0
    assert recording.signals['gear/torque'].rate_hz == pytest.approx(200.0, rel=1e-3)


@pytest.mark.long
@pytest.mark.slow
def test_compare_places_a_recording_and_agrees_with_it(tmp_path):
    make_recording(tmp_path / 'bag', SHEET, 9.0, 30.0, 7)
    found = pipeline.compare([str(tmp_path / 'bag')], FILE)['recordings'][0]
    assert found['speed_m_s']['value'] == pytest.approx(0.5, rel=2e-3)
    length = Chain(SHEET).curve.length
    off = (found['start_s_m'] - 9.0 + 0.5 * length) % length - 0.5 * length
    assert abs(off) < 0.03
    # its rails and gears are rigid: what depends on how treads yield agrees less, and handrails
    # share no clock with the steps
    for name, least in AGREEMENT.items():
        assert found['channels'][name]['r_time'] > least
