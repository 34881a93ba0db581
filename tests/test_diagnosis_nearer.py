"""What tolerances explain without an effect is nothing that the effect explains."""

from types import SimpleNamespace

import pytest

from escalator_twin.diagnosis import bounds, hollows
from escalator_twin.diagnosis import walk as module
from escalator_twin.diagnosis.polish import Polished
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.stage import LARGEST
from escalator_twin.diagnosis.tried import Tried
from escalator_twin.diagnosis.walk import Bench, walk
from escalator_twin.errors import EscalatorError

pytestmark = pytest.mark.issue(6)

SPRING = 'tensioner.stiffness_n_m'
STIFF = Proposal(
    'tensioner_stiffness', {}, {'factor': 1.08}, 1600.0, fitted=('factor',), nuisance=SPRING
)
STEP = Proposal('guide_step', {'s_m': 6.7, 'side': 'left'}, {'height_m': 6e-4}, 2600.0)


class Level(SimpleNamespace):
    """A place, as far as it says what is left and which tolerances are turned."""

    @classmethod
    def of(cls, left, turned=()):
        stage = SimpleNamespace(turned=dict(turned), tolerances={SPRING: 0.02})
        return cls(stage=stage, left=left)


def fitted(effect, left):
    polished = Polished(None, Level.of(left, {'chain.mass': 1.1}), (effect,), ({},))
    return Tried(effect, effect.gain, {}, polished)


@pytest.mark.parametrize(
    ('effect', 'with_it', 'without', 'aligned', 'is_nearer'),
    [
        (STEP, 11500.0, 11520.0, 11300.0, True),
        (STIFF, 12500.0, 12400.0, 12400.0, True),
        (STEP, 11500.0, 12900.0, 11300.0, False),  # its tolerances take less than half without it
        (STEP, 11500.0, 11520.0, 12900.0, False),  # or do once they are run
        (STEP, 14100.0, 14000.0, 13000.0, False),  # explains nothing where these are judged
    ],
)
def test_tolerances_that_take_most_without_the_effect_are_the_machines(
    monkeypatch, effect, with_it, without, aligned, is_nearer
):
    seen = []

    def level_of(_place, stage):
        seen.append(stage.turned)
        return without

    monkeypatch.setattr(hollows, 'quiet_chi2', lambda place: place.left)
    monkeypatch.setattr(hollows, 'level_of', level_of)
    monkeypatch.setattr(
        hollows, 'replace', lambda one, **changed: SimpleNamespace(**{**vars(one), **changed})
    )
    monkeypatch.setattr(hollows, 'with_own_tolerances', lambda *_: SimpleNamespace(place=None))
    monkeypatch.setattr(hollows, 'beside', lambda *_, turned, **__: Level.of(aligned, turned))
    found = hollows.out_of_hollow(None, Level.of(14100.0), fitted(effect, with_it))
    assert (found is not None) == is_nearer
    own = (
        {SPRING: LARGEST} if effect is STIFF else {}
    )  # 4 tolerances, of which a good machine has 2.5
    assert all(turned == {'chain.mass': 1.1, **own} for turned in seen)
    if found is not None:
        context, place = found
        assert context.place is place
        assert place.stage.turned == {'chain.mass': 1.1, **own}


def test_tolerances_that_no_machine_runs_with_end_no_diagnosis(monkeypatch):
    def level_of(*_):
        raise EscalatorError('the simulation diverged')

    monkeypatch.setattr(hollows, 'quiet_chi2', lambda place: place.left)
    monkeypatch.setattr(hollows, 'level_of', level_of)
    monkeypatch.setattr(hollows, 'replace', lambda *_, **__: None)
    assert hollows.out_of_hollow(None, Level.of(14100.0), fitted(STEP, 11500.0)) is None


def test_a_round_begins_anew_beside_the_nearer_machine_once(monkeypatch):
    far, near = Level.of(14100.0), Level.of(11300.0)
    monkeypatch.setattr(module, 'freed', lambda place, _: place)
    monkeypatch.setattr(module, 'may_hide', lambda *_: False)
    monkeypatch.setattr(module, 'explained_by', lambda *_: 1.0)
    for name, value in {
        'is_open': True, 'is_stretched': False, 'is_used_up': False, 'excess_of': 2e4, 'fell_by': 1e9,
    }.items():  # fmt: skip
        monkeypatch.setattr(bounds, name, lambda *_, __value=value: __value)
    asked, searched = [], []

    def propose(_context, place, _jobs):
        searched.append(place)
        return [STIFF] if place is far else []

    def attempt(_context, _place, _known, chosen, *_):
        return [fitted(p, 12500.0) for p in chosen]

    def nearer(context, place, _tried, _jobs):
        asked.append(place)
        return context, near

    bench = Bench(
        propose, attempt, lambda *_: None, lambda place, _: place, lambda *_: None, lambda *_: {},
        nearer,
    )  # fmt: skip
    found = walk(SimpleNamespace(place=far, floor=None), bench=bench)
    assert searched == [far, near]
    assert asked == [far]
    assert found.found == ()
    assert found.before is found.after is near
