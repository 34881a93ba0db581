"""What recordings make of effects whose sizes they are told: the benchmark's own sums."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from benchmarks import confirming

pytestmark = pytest.mark.issue(7)

CHAIN = {
    'cause': 'chain_elongation',
    'location': {'side': 'both'},
    'parameters': {'length_m': 1.5e-4},
}
ROLLER = {
    'cause': 'roller_eccentricity',
    'location': {'axle': 41, 'side': 'left'},
    'parameters': {'amplitude_m': 4e-4, 'phase_rad': 1.0},
}
SPRING = {'cause': 'tensioner_stiffness', 'location': {}, 'parameters': {'factor': 0.8}}
RIPPLE = {
    'cause': 'drive_ripple',
    'location': {},
    'parameters': {'relative_amplitude': 0.02, 'cycles_per_pitch': 1.4, 'phase_rad': 0.3},
}


def test_a_truths_effects_are_named_with_their_sizes_and_without_how_a_roller_stood():
    chain, roller, spring = confirming.named([CHAIN, ROLLER, SPRING])
    assert (chain.parameters, chain.fitted) == ({'length_m': 1.5e-4}, ('length_m',))
    assert roller.parameters == {'amplitude_m': 4e-4, 'phase_rad': 0.0, 'slip': 0.0}
    assert roller.fitted == ('amplitude_m', 'phase_rad', 'slip')
    assert spring.nuisance == 'tensioner.stiffness_n_m'


def test_a_wave_whose_phase_no_truth_tells_is_refused():
    with pytest.raises(ValueError, match='drive_ripple: its phase'):
        confirming.named([RIPPLE])


def test_sizes_are_judged_from_where_the_cause_is_absent(monkeypatch, tmp_path):
    """A factor of 0.8 told as 0.79 is a twentieth too much, by a spread of a tenth."""
    (tmp_path / 'truth').mkdir()
    (tmp_path / 'truth' / 'one.json').write_text(confirming.json.dumps({'effects': [SPRING]}))
    monkeypatch.setattr(confirming.bagfile, 'read', lambda *_: None)

    def confirm(_recording, _machine, effects):
        own = tuple(replace(e, parameters={'factor': 0.79}) for e in effects)
        left = SimpleNamespace(significant=True, share=0.1)
        return SimpleNamespace(effects=own, sd=({'factor': 0.02},), unexplained=left)

    monkeypatch.setattr(confirming, 'confirm_recording', confirm)
    line = confirming.confirmed('one', tmp_path, confirming.MACHINE)
    row = {'cause': 'tensioner_stiffness', 'parameter': 'factor', 'off': 0.05, 'sd': 0.1}
    assert line['effects'] == [row]
    assert (line['flagged'], line['share']) == (True, 0.1)


def test_figures_tell_each_causes_errors_and_whether_intervals_hold():
    def line(off, sd, flagged):
        row = {'cause': 'roller_drag', 'parameter': 'force_N', 'off': off, 'sd': sd}
        return {'effects': [row], 'flagged': flagged, 'share': 0.02, 'seconds': 40.0}

    lines = [line(0.01, 0.01, False), line(-0.03, 0.01, True), line(0.02, 0.01, False)]
    rows = {row['name']: row for row in confirming.figures_of(lines)}
    assert rows['size_error']['value'] == 0.02
    assert rows['size_off_from_to']['value'] == [-0.03, 0.02]
    # 0.02 is over 1.96 standard deviations
    assert (rows['intervals_hold']['hits'], rows['intervals_hold']['trials']) == (1, 3)
    assert rows['flagged']['hits'] == 1
