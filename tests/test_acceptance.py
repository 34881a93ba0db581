"""The bars on recordings that other people made; each test names its issue."""

from dataclasses import replace
import json

import pytest

from escalator_twin import bagfile
from escalator_twin.cli.main import main
from escalator_twin.comparison.document import recording_document
from escalator_twin.machine import load_machine
from escalator_twin.pipeline import compare_recording

pytestmark = pytest.mark.shared
FORCES = ('left_a', 'left_b', 'right_a', 'right_b')


@pytest.fixture(scope='module')
def clean(shared, tmp_path_factory):
    """Return the comparison of both recordings without a deviation."""
    file = tmp_path_factory.mktemp('clean') / 'clean.json'
    bags = [str(shared / 'measured' / 'seeded' / name) for name in ('clean_1', 'clean_2')]
    assert main(['compare', *bags, '--json', str(file), '--jobs', '1']) == 0
    return json.loads(file.read_text())['recordings']


@pytest.mark.issue(2)
def test_a_clean_machine_correlates(clean):
    for recording in clean:
        channels = recording['channels']
        for link in FORCES:
            assert channels[f'link_force/{link}']['r_time'] >= 0.995
        assert channels['tensioner/displacement']['r_time'] >= 0.98
        for axis in 'xz':
            assert channels[f'step/acceleration/{axis}']['r_time'] >= 0.995


@pytest.mark.issue(2)
def test_the_ripple_of_link_force_reaches_its_ceiling(clean):
    for recording in clean:
        for link in FORCES:
            scores = recording['channels'][f'link_force/{link}']
            assert scores['ripple_r'] >= 0.8 * scores['ripple_ceiling']


@pytest.mark.issue(5)
def test_a_clean_machine_meets_the_tighter_bars(clean):
    for recording in clean:
        channels = recording['channels']
        for link in FORCES:
            scores = channels[f'link_force/{link}']
            assert scores['r_time'] >= 0.999
            assert scores['ripple_r'] >= 0.9 * scores['ripple_ceiling']
        assert channels['tensioner/displacement']['r_time'] >= 0.995
        for axis in 'xz':
            assert channels[f'step/acceleration/{axis}']['r_time'] >= 0.999


@pytest.mark.issue(5)
def test_clocks_agree_by_both_estimates(clean):
    first = clean[0]['clock']
    assert first['offset_s'] == pytest.approx(0.60, abs=0.01)
    assert first['drift_ppm'] == pytest.approx(22.0, abs=5.0)
    for recording in clean:
        clock = recording['clock']
        signals = clock['by_signals']
        assert signals['offset_s'] == pytest.approx(clock['offset_s'], abs=0.015)
        assert signals['drift_ppm'] == pytest.approx(clock['drift_ppm'], abs=15.0)
        assert not recording['quality']


@pytest.mark.issue(5)
@pytest.mark.parametrize('i', [0, 1])
def test_signals_alone_tie_the_clocks(clean, root, i):
    machine = load_machine(root / 'config' / 'machines' / 'prototype.yaml')
    recording = bagfile.read(clean[i]['path'], machine)
    # a bag that was rewritten: its time is that of the stamps and tells nothing
    signals = {c: replace(s, bag_ns=s.stamp_ns) for c, s in recording.signals.items()}
    recording = replace(recording, signals=signals)
    setting, judgement = compare_recording(recording, machine)
    clock = recording_document(recording, setting, judgement, machine)['clock']
    assert not clock['by_bag_time']['offset_s']
    by_bag_time = clean[i]['clock']
    period = machine.chain.pitch_m / clean[i]['speed_m_s']['value']
    off = clock['offset_s'] - by_bag_time['offset_s']
    assert abs((off + period / 2) % period - period / 2) < 0.015
    assert clock['drift_ppm'] == pytest.approx(by_bag_time['drift_ppm'], abs=15.0)


@pytest.mark.issue(2)
@pytest.mark.slow
def test_every_recording_of_the_campaign_gives_numbers(shared, tmp_path):
    file = tmp_path / 'campaign.json'
    bags = sorted(str(p) for p in (shared / 'measured' / 'campaign').iterdir() if p.is_dir())
    assert main(['compare', *bags, '--json', str(file)]) == 0
    recordings = json.loads(file.read_text())['recordings']
    assert [r['path'] for r in recordings] == bags
    for recording in recordings:
        assert len(recording['channels']) == 8
        for scores in recording['channels'].values():
            assert -1.0 <= scores['r_time'] <= 1.0
        real = recording['speed_m_s']['value'] / recording['set_speed_m_s']
        assert abs(real - 1.0) < 0.07
