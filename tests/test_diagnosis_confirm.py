"""One more recording beside effects that others named: sizes stay, how a roller stood is its own.

The recording is made by the generator (synthetic).
"""

from dataclasses import replace
from types import SimpleNamespace

import pytest
from rig.machine import Case
from rig.make import Effect, make, Order, write
import trials

from escalator_twin import bagfile
from escalator_twin.diagnosis import confirm, settling
from escalator_twin.diagnosis.proposals import Proposal

pytestmark = [pytest.mark.issue(7), pytest.mark.slow]

LONGER_M, LINK_M, ECCENTRIC_M = 1.5e-4, 3e-3, 4e-4
PLACE = {'axle': 41, 'side': 'left'}
SOFT = 0.6  # the sides' stiffness against each other over the data sheet's, at most
SEED = 251197


@pytest.fixture(scope='module')
def confirmed(tmp_path_factory):
    machine = trials.prototype()
    path = tmp_path_factory.mktemp('confirm') / 'bag'
    effects = (
        Effect('chain_elongation', {'side': 'both'}, {'length_m': LONGER_M}),
        Effect('link_elongation', {'link': 12}, {'length_m': LINK_M}),
        Effect('roller_eccentricity', PLACE, {'amplitude_m': ECCENTRIC_M}),
    )
    made = make(Order(SEED, Case(0.25, 1, 75.0, 3000.0), 110.0, effects))
    assert made.truth['tolerances']['racking_stiffness'] < SOFT
    write(made, path, None)
    named = [
        Proposal('chain_elongation', {'side': 'both'}, {'length_m': LONGER_M}, 1e4, fitted=('length_m',)),
        Proposal('link_elongation', {'link': 12}, {'length_m': LINK_M}, 1e4, fitted=('length_m',)),
        Proposal(
            'roller_eccentricity', PLACE, {'amplitude_m': ECCENTRIC_M, 'phase_rad': 0.0, 'slip': 0.0}, 1e4,
            fitted=('amplitude_m', 'phase_rad', 'slip'),
        ),
    ]  # fmt: skip
    return confirm.confirm_recording(bagfile.read(path, machine), machine, named)


def test_a_treads_size_is_the_others(confirmed):
    own = confirmed.effects[2].parameters['amplitude_m']
    print(confirmed.effects, confirmed.sd)
    assert own == pytest.approx(ECCENTRIC_M, rel=0.06)


def test_little_is_left_where_an_eccentric_roller_shows(confirmed):
    left = {name: row['chi2'] for name, row in confirmed.residual['after'].items()}
    print(left, confirmed.unexplained.significant, confirmed.unexplained.share)
    assert max(left[f'link_force/{side}_b'] for side in ('left', 'right')) < 1.1
    assert not confirmed.unexplained.significant


DRAG = Proposal('roller_drag', PLACE, {'force_N': 120.0}, 1e3, fitted=('force_N',))
LINK = Proposal('link_elongation', {'link': 12}, {'length_m': LINK_M}, 1e4, fitted=('length_m',))


@pytest.mark.parametrize('effects', [[DRAG, LINK], [LINK]], ids=['one side', 'both'])
def test_sizes_are_kept_and_only_what_acts_on_one_side_is_settled(monkeypatch, effects):
    asked = []

    class Fit:
        def __init__(self, _, known, *__):
            asked.append(known)

        def beside(self, effects, *_):
            asked.append(list(effects))
            return 'aligned'

        def columns(self, *_):
            return None

        def step(self, *_):
            return None

    monkeypatch.setattr(settling, 'JointFit', Fit)
    place = SimpleNamespace(stage=SimpleNamespace(turned={}))
    found, kept = settling.settled(None, place, effects)
    assert kept == effects
    if DRAG in effects:
        assert asked == [(), [replace(DRAG, fitted=()), replace(LINK, fitted=())]]
        assert found == 'aligned'
    else:
        assert asked == []
        assert found is place


def test_two_waves_of_one_cause_keep_their_own_numbers(monkeypatch):
    def wave(turns):
        numbers = {'relative_amplitude': 0.02, 'cycles_per_pitch': turns, 'phase_rad': 0.1}
        return Proposal('drive_ripple', {}, numbers, 1e3, fitted=('relative_amplitude',))

    fit = SimpleNamespace(
        beside=lambda *_: 'aligned', columns=lambda *_: None, step=lambda *_: None
    )
    monkeypatch.setattr(settling, 'JointFit', lambda *_: fit)
    place = SimpleNamespace(stage=SimpleNamespace(turned={}))
    effects = [wave(0.37), DRAG, wave(1.4)]
    assert settling.settled(None, place, effects)[1] == effects


def kicked(monkeypatch, levels, is_open=True):
    """Run `led_whole` where each turn and fit comes to the next of some levels."""
    left = iter(levels)

    def place(level):
        stage = SimpleNamespace(turned={}, judged=lambda *_: level)
        return SimpleNamespace(stage=stage, fitted=None)

    monkeypatch.setattr(settling, 'is_open', lambda *_: is_open)
    monkeypatch.setattr(settling, 'far_turns', lambda *_: [{'a': 1.2}])
    monkeypatch.setattr(settling, 'most_explaining', lambda *_: ({'a': 1.2}, next(left)))
    fit = SimpleNamespace(beside=lambda *_: 'near')
    monkeypatch.setattr(settling, 'JointFit', lambda *_: fit)
    monkeypatch.setattr(
        settling,
        'polish_whole',
        lambda p: SimpleNamespace(context=p.context, place=place(next(left)), effects=p.effects),
    )
    context = SimpleNamespace(floor=None, weak=frozenset())
    start = place(1e4)
    _, found, effects = settling.led_whole(context, start, [LINK])
    assert effects == [LINK]
    return found.stage.judged(), found is start


@pytest.mark.parametrize(
    ('levels', 'ends'),
    [((9e3, 8e3, 7e3, 6e3, 6e3), 6e3), ((9e3, 1.1e4), 1e4), ((9999.0,), 1e4)],
    ids=['two rounds', 'no better fitted', 'no turn'],
)
def test_what_is_left_open_is_led_on_with_the_effects_in_the_runs(monkeypatch, levels, ends):
    level, stays = kicked(monkeypatch, levels)
    assert level == ends
    assert stays == (ends == 1e4)


def test_nothing_is_turned_far_where_nothing_is_open(monkeypatch):
    assert kicked(monkeypatch, (), is_open=False) == (1e4, True)
