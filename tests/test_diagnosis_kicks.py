"""Leaving a hollow: one tolerance is turned far, with the effects in the run."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from escalator_twin.diagnosis import polish, tuning
from escalator_twin.diagnosis.descent import Descent, far_turns
from escalator_twin.diagnosis.proposals import Proposal

pytestmark = pytest.mark.issue(6)

SOFT = Proposal('link_stiffness', {'link': 8, 'side': 'right'}, {'factor': 0.3}, 9e3)
LANDING = Proposal('landing_length', {}, {'delta_m': 6e-3}, 9e3, nuisance='guide.upper_landing_m')
KNOBS = tuple(
    SimpleNamespace(name=name)
    for name in ('chain.mass', 'roller.contact', 'guide.upper_landing_m', 'guide.lower_landing_m')
)


def place(level):
    stage = SimpleNamespace(
        knobs=KNOBS,
        turned={'roller.contact': 2.0},
        judged=lambda fitted, _cause=None: fitted,
    )
    return SimpleNamespace(stage=stage, fitted=level)


def test_one_tolerance_is_turned_at_a_time_within_its_bounds():
    found = far_turns(place(0.0).stage, 1.2, {'guide.lower_landing_m'})
    assert found == [
        {'chain.mass': -1.2},
        {'chain.mass': 1.2},
        {'roller.contact': pytest.approx(0.8)},  # 3.2 standard deviations are an effect's
        {'guide.upper_landing_m': -1.2},
        {'guide.upper_landing_m': 1.2},
    ]


@pytest.mark.parametrize(
    ('level', 'is_followed'),
    [(6e3, True), (9.98e3, False)],  # the second gains less than is asked for
)
def test_a_turn_that_gains_enough_is_followed(monkeypatch, level, is_followed):
    seen = []

    def most_explaining(_start, ways, _jobs):
        seen.extend(name for way in ways for name in way)
        return {'roller.contact': -1.0}, level

    monkeypatch.setattr(polish, 'most_explaining', most_explaining)
    context = SimpleNamespace(weak=frozenset({'guide.lower_landing_m'}))
    begun = polish.Polished(context, place(1e4), (LANDING, SOFT), ())
    found = polish.farther(begun, 1, worth=50.0)
    assert found == ({'roller.contact': -1.0} if is_followed else None)
    # what a known effect stands for is in its size, and what hardly shows is left
    assert set(seen) == {'chain.mass', 'roller.contact'}


@pytest.mark.parametrize(('most', 'kicks'), [(2e4, len(tuning.KICKS)), (9e3, 0)])
def test_beside_what_leads_far_above_all_else_no_tolerance_is_turned_far(monkeypatch, most, kicks):
    turns = []

    class Search(Descent):
        def __init__(self):
            """Search nothing."""

        def descend(self, turned, _cut_hz=None):
            return turned, 1e4, place(1e4)

        def kicked(self, _start, by):
            turns.append(by)
            return {}, 1e4

    monkeypatch.setattr(tuning, 'Descent', lambda *_: Search())
    monkeypatch.setattr(tuning, '_doubted', lambda lean: lean)
    monkeypatch.setattr(tuning, 'replace', lambda search, **_: search)
    begun = place(1e4)
    begun.model, begun.stage.lean = None, lambda _: None
    turned, level = tuning.coarse_to_fine(None, begun, most=most)
    assert len(turns) == kicks
    assert (turned, level) == (begun.stage.turned, 1e4)


@pytest.mark.parametrize(
    ('level', 'turned', 'before', 'goes_on'),
    [
        (polish.HOPELESS * 1e3 - 1.0, 0.0, 1e4, True),
        (polish.HOPELESS * 1e3, 0.0, 1e4, False),
        (polish.HOPELESS * 1e3, 0.8, 1e4, False),
        (polish.HOPELESS * 1e3, 1.2, 1e4, True),  # the size takes it over, and more may follow
        (polish.HOPELESS * 1e3, 1.2, polish.HOPELESS * 1.02e3, False),  # but that led nowhere
    ],
)
def test_what_leads_far_above_all_else_is_left_where_no_more_may_follow(
    level, turned, before, goes_on
):
    asked = []

    class Fit:
        def tuned(self, _effects, _held, _jobs, _rounds, most):
            assert most == polish.HOPELESS * 1e3
            return {'guide.upper_landing_m': turned}, level

        def taken_anew(self, *_):
            asked.append('anew')
            return self

        def beside(self, *_):
            return place(900.0)

    begun = place(before)
    begun.stage.tolerances = {'guide.upper_landing_m': 1e-3}
    landing = replace(LANDING, fitted=('delta_m',))
    found = polish.approach(Fit(), begun, (landing,), most=1e3)
    assert bool(asked) == goes_on
    assert (found[1] is begun) == (not goes_on)
