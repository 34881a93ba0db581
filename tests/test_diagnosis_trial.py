"""What is fitted from the machine as described: what promises most, and what a tolerance stands in for."""

from concurrent.futures import ThreadPoolExecutor
from types import SimpleNamespace

import pytest

from escalator_twin.diagnosis import trial
from escalator_twin.diagnosis.afar import Afar
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.tried import Tried

pytestmark = pytest.mark.issue(7)

ROLLING = Proposal('rolling_resistance', {}, {'factor': 0.74}, 500.0)
LANDING = Proposal('landing_length', {'which': 'upper'}, {'delta_m': -3.6e-3}, 18.0)
EDGE = Proposal('landing_length', {'which': 'upper'}, {'delta_m': 2.4e-3}, 0.0)
FRICTION = Proposal('tensioner_friction', {}, {'force_N': 180.0}, 9e4)


@pytest.mark.parametrize(
    ('edges', 'fitted'),
    [
        ((), [ROLLING]),
        ((EDGE,), [ROLLING, EDGE]),
        ((ROLLING,), [ROLLING]),  # leads already: once is enough
    ],
)
def test_what_a_tolerance_stands_in_for_is_fitted_whatever_it_promises(monkeypatch, edges, fitted):
    monkeypatch.setattr(trial, 'refine', lambda *given: SimpleNamespace(
        proposal=given[3], gain=given[3].gain
    ))  # fmt: skip
    done = []

    def fitted_beside(_context, _place, _known, refined, _turned, _share):
        done.append(refined.proposal)
        return Tried(refined.proposal, refined.gain, {})

    monkeypatch.setattr(trial, 'fitted_beside', fitted_beside)
    stage = SimpleNamespace(judged=lambda _: 1e4)
    place = SimpleNamespace(stage=stage, model=None, fitted=None)
    afar = Afar(None, place, [ROLLING, LANDING], edges)
    with ThreadPoolExecutor(1) as pool:
        trial._tried_afar(None, afar, place, [FRICTION], pool, 1, 1e4)
    assert done == fitted


@pytest.mark.parametrize(
    ('cause', 'is_open', 'is_closed'),
    [('roller_drag', False, True), ('roller_drag', True, False), ('guide_step', False, False)],
)
def test_an_effect_of_one_axle_that_leaves_nothing_needs_no_rival_from_afar(
    monkeypatch, cause, is_open, is_closed
):
    monkeypatch.setattr(trial, 'is_open', lambda *_: is_open)
    fit = SimpleNamespace(place=None)
    first = Tried(Proposal(cause, {}, {}, 900.0), 900.0, {}, fit)
    second = Tried(Proposal('guide_step', {}, {}, 30.0), 30.0, {}, fit)
    unfitted = Tried(Proposal('step_mass', {}, {}, 2000.0), 2000.0, {}, None)
    assert trial.is_closed([second, first, unfitted], None) is is_closed
    assert not trial.is_closed([unfitted], None)
