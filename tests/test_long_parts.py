"""A long recording is compared part by part, and the parts are pooled."""

from makers import (
    PROTOTYPE,
)
import numpy as np
import pytest

from escalator_twin import pipeline
from escalator_twin.comparison import parts

pytestmark = pytest.mark.issue(5)

LEFT_A = 'link_force/left_a'


def part_document(speed, findings=(), **scores):
    return {
        'path': 'a',
        'start_s_m': 1.0,
        'speed_m_s': {'value': speed, 'low': speed - 3e-4, 'high': speed + 4e-4},
        'place_is_certain': True,
        'clock': {'offset_s': 0.5},
        'channels': {LEFT_A: {'r_time': 0.5, 'nrmse': 0.5, 'ceiling_r_time': None, **scores}},
        'sides': {'link a': {'share': 0.5 + speed}},
        'sensor_pose': {},
        'quality': [
            dict(zip(('kind', 'channel', 'from_s', 'to_s', 'detail'), f, strict=True))
            for f in findings
        ],
        'overlay': {'of': speed},
    }


def test_parts_pool_what_can_be_pooled():
    rng = np.random.default_rng(2)
    m = rng.standard_normal(3000).cumsum()
    s = m + rng.standard_normal(3000)
    halves = [slice(0, 1000), slice(1000, 3000)]
    sums = []
    for half in halves:
        a, b = (row[half] - row[half].mean() for row in (m, s))
        m[half], s[half] = a, b
        pair = np.array([a @ a, b @ b, a @ b, len(a)])
        sums.append({LEFT_A: dict.fromkeys(set(parts.CORRELATIONS.values()), pair)})
    order = [[{'phase_deg': v, 'coherence': None}] for v in (179.0, -178.0)]
    documents = [
        part_document(0.5, r_freq=0.9, orders=order[0]),
        part_document(0.6, r_freq=0.6, orders=order[1]),
    ]
    merged = parts.merge_parts(documents, sums, [(0.0, 300.0), (300.0, 900.0)])
    scores = merged['channels'][LEFT_A]
    assert scores['r_time'] == pytest.approx(np.corrcoef(m, s)[0, 1])
    assert scores['nrmse'] == pytest.approx(np.std(m - s) / np.std(m))
    assert scores['ceiling_r_time'] is None
    assert scores['r_freq'] == pytest.approx(0.7)
    assert abs(scores['orders'][0]['phase_deg']) == pytest.approx(179.0, abs=0.01)
    assert scores['orders'][0]['coherence'] is None
    assert merged['speed_m_s']['value'] == pytest.approx(0.5 + 0.2 / 3)
    assert 0.0 < merged['speed_m_s']['value'] - merged['speed_m_s']['low'] < 3e-4
    assert merged['sides']['link a']['share'] == pytest.approx(0.5 + merged['speed_m_s']['value'])
    assert merged['overlay'] == {'of': 0.5}
    assert merged['parts']['n'] == 2
    assert 'r_time' in merged['parts']['pooled']
    assert 'r_freq' in merged['parts']['averaged']


def test_findings_of_parts_are_in_the_time_of_the_recording():
    gap = ('data_gap', LEFT_A, 3.0, 7.0, '800 samples missing')
    clock = ('clock_drift', '', 0.0, 0.0, 'too fast')
    documents = [part_document(0.5, [gap, clock]), part_document(0.5, [gap, clock])]
    sums = [{LEFT_A: dict.fromkeys(set(parts.CORRELATIONS.values()), np.ones(4))}] * 2
    found = parts.merge_parts(documents, sums, [(0.0, 600.0), (600.0, 900.0)])['quality']
    assert [(row['kind'], row['from_s']) for row in found] == [
        ('data_gap', 3.0),
        ('clock_drift', 0.0),
        ('data_gap', 603.0),
    ]


@pytest.mark.slow
@pytest.mark.shared
def test_parts_agree_with_the_whole(shared, monkeypatch):
    path = str(shared / 'measured' / 'campaign' / 'case_01_low_up_empty_lo')
    whole = pipeline.compare_bag(path, PROTOTYPE)
    monkeypatch.setattr(parts, 'LONG_S', 60.0)
    monkeypatch.setattr(parts, 'PART_S', 90.0)
    merged = pipeline.compare_bag(path, PROTOTYPE)
    assert merged['parts']['n'] == 2
    assert merged['speed_m_s']['value'] == pytest.approx(whole['speed_m_s']['value'], rel=1e-3)
    assert merged['start_s_m'] == pytest.approx(whole['start_s_m'], abs=0.015)
    for channel in ('link_force/left_a', 'tensioner/displacement', 'step/acceleration/z'):
        one, other = (d['channels'][channel] for d in (merged, whole))
        assert one['r_time'] == pytest.approx(other['r_time'], abs=2e-3)
        assert one['nrmse'] == pytest.approx(other['nrmse'], abs=0.02)
