"""Leaving a hollow: one tolerance is turned far, with the effects in the run."""

from types import SimpleNamespace

import pytest

from escalator_twin.diagnosis import polish
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.tuning import far_turns

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
