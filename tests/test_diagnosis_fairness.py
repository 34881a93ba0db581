"""A rail's step beside rivals: what it shares with them, and when it is fitted."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from types import SimpleNamespace

import pytest

from escalator_twin.diagnosis import fairness, trial
from escalator_twin.diagnosis.afar import Afar
from escalator_twin.diagnosis.polish import Polished
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.refine import Refined
from escalator_twin.diagnosis.tried import Tried

pytestmark = pytest.mark.issue(7)

LANDING = Proposal('landing_length', {'which': 'upper'}, {'delta_m': -3.6e-3}, 18.0)
STEP = Proposal('guide_step', {'s_m': 1.1, 'side': 'left'}, {'height_m': -9e-4}, 2e4)
PRELOAD = Proposal('tensioner_preload', {}, {'factor': 0.84}, 1.1e4)


@dataclass(frozen=True)
class Left:
    """What is left of a recording: chi squared where nothing rattles, and in all."""

    quiet: float
    chi2: float

    @property
    def fitted(self):
        return self

    @property
    def stage(self):
        return SimpleNamespace(judged=lambda fitted: fitted.quiet)


@pytest.mark.parametrize(
    ('landing', 'expected'),
    [
        (Left(800.0, 3_000.0), 1_000.0),  # explains as much elsewhere, and all of it there
        (Left(800.0, 9_000.0), 4_200.0),  # some of it there
        (Left(950.0, 3_000.0), 5_000.0),  # less elsewhere: no rival
        (Left(800.0, 12_000.0), 5_000.0),  # there it makes worse: dice
    ],
)
def test_a_rails_step_must_explain_more_than_a_rival_does_there(landing, expected):
    before, after = Left(1_000.0, 10_000.0), Left(900.0, 5_900.0)
    step = Tried(Proposal('guide_step', {}, {}, 0.0), 5_000.0, {}, Polished(None, after, (), ()))
    rival = Tried(LANDING, 200.0, {}, Polished(None, landing, (), ()))
    found = fairness.shared(before, [step, rival])
    assert [t.gain for t in found] == [expected, 200.0]
    # what was run once and not fitted shares as well: it outbid a preload that closed all (seed 9013)
    run = Tried(step.proposal, 5_000.0, {}, falls=fairness.falls_of(before, after.stage, after))
    assert [t.gain for t in fairness.shared(before, [run, rival])] == [expected, 200.0]


@pytest.mark.issue(7)
@pytest.mark.parametrize(
    ('side', 's_m', 'is_fitted'),
    [('both', 1.106, True), ('left', 1.106, False), ('both', 1.6, False)],
)
def test_a_step_that_was_fitted_is_not_weighed_as_it_was_run_too(side, s_m, is_fitted):
    def step(side, s_m):
        return Proposal('guide_step', {'side': side, 's_m': s_m}, {'height_m': 1e-3}, 2e4)

    done = Tried(step('both', 1.108), 8e3, {}, Polished(None, Left(1.0, 1.0), (), ()))
    assert fairness.is_fitted(step(side, s_m), [done]) is is_fitted
    assert not fairness.is_fitted(step(side, s_m), [replace(done, polished=None)])


def leveled(quiet):
    """Return a machine beside a recording, by what is left of it where nothing rattles."""
    stage = SimpleNamespace(
        judged=lambda fitted, *_: fitted.quiet, observation=SimpleNamespace(frame=None)
    )
    stage.lean = lambda _: stage
    return SimpleNamespace(model=None, fitted=Left(quiet, 2.0 * quiet), stage=stage)


@pytest.mark.issue(7)
@pytest.mark.parametrize(
    ('cause', 'gain', 'leads'),
    [
        ('guide_step', 13e3, True),  # 23 - 13 is less than the 12 that a step leaves
        ('guide_step', 10e3, False),
        ('guide_step', None, False),  # it does not run
        ('roller_drag', 13e3, False),
    ],
)
def test_what_leaves_less_from_afar_is_fitted_before_a_rails_steps(
    monkeypatch, cause, gain, leads
):
    afar = Afar(None, leveled(23e3), [PRELOAD])
    step = Refined(replace(STEP, cause=cause), None, Left(12e3, 3e4), 2e4, {}, None, ())
    run = None if gain is None else SimpleNamespace(gain=gain)
    monkeypatch.setattr(trial, 'refine', lambda *_: run)
    with ThreadPoolExecutor(1) as pool:
        assert trial._leads_from_afar(afar, leveled(18e3).stage, [step], pool) is leads
        assert not trial._leads_from_afar(afar, leveled(18e3).stage, [], pool)
        none = replace(afar, proposals=[])
        assert not trial._leads_from_afar(none, leveled(18e3).stage, [step], pool)


@pytest.mark.issue(7)
@pytest.mark.parametrize(
    ('leads', 'closes', 'order'),
    [
        (True, True, ['afar', []]),
        (True, False, ['afar', ['guide_step']]),
        (False, True, [['guide_step'], 'afar']),
    ],
)
def test_what_closes_from_afar_spares_the_fits_of_a_rails_steps(monkeypatch, leads, closes, order):
    place = leveled(18e3)
    step = Refined(STEP, None, Left(12e3, 16e3), 2e4, {}, None, ())
    done, preload = [], Tried(PRELOAD, 1.1e4, {}, Polished(None, leveled(7e3), (), ()))
    given = {
        'pairs': [], 'refine': step, '_leads_from_afar': leads, 'closes': closes, 'other_sides': [],
    }  # fmt: skip
    for name, result in given.items():
        monkeypatch.setattr(trial, name, lambda *_, result=result: result)
    monkeypatch.setattr(
        trial, '_fitted_all', lambda *a: done.append([r.proposal.cause for r in a[3]]) or []
    )
    monkeypatch.setattr(trial, 'tried_from_afar', lambda *_: done.append('afar') or [preload])
    for name in ('from_far', 'from_other_frequencies'):
        monkeypatch.setattr(trial, name, lambda *a: a[3])
    monkeypatch.setattr(trial, 'weighed_by_passages', lambda tried: tried)
    for name in ('locked', '_settled'):
        monkeypatch.setattr(trial, name, lambda *a: a[2])
    afar = Afar(None, leveled(23e3), [PRELOAD])
    found = trial.try_all(SimpleNamespace(floor=None), place, (), [STEP], 1, afar, lambda *_: True)
    assert done == order
    assert found[0] is preload  # explains eleven of the step's twenty as well


@pytest.mark.issue(7)
def test_of_a_step_that_was_fitted_as_the_leading_ones_other_side_one_is_weighed(monkeypatch):
    place = leveled(18e3)
    both = replace(STEP, location={'s_m': 1.102, 'side': 'both'}, gain=1.3e4)
    runs = {
        id(p): Refined(p, None, Left(12e3, 16e3), gain, {}, None, ())
        for p, gain in ((STEP, 2.2e4), (both, 1.5e4))
    }
    fits = {
        p.location['side']: Tried(p, 9e3, {}, Polished(None, leveled(11e3), (), ()))
        for p in (STEP, both)
    }
    monkeypatch.setattr(trial, 'pairs', lambda *_: [])
    monkeypatch.setattr(trial, 'refine', lambda *given: runs[id(given[3])])
    monkeypatch.setattr(trial, '_fitted_all', lambda *_: [fits['left']])
    monkeypatch.setattr(trial, 'other_sides', lambda *_: [fits['both']])
    for name in ('from_far', 'from_other_frequencies'):
        monkeypatch.setattr(trial, name, lambda *a: a[3])
    monkeypatch.setattr(trial, 'weighed_by_passages', lambda tried: tried)
    for name in ('locked', '_settled'):
        monkeypatch.setattr(trial, name, lambda *a: a[2])
    found = trial.try_all(None, place, (), [STEP, both], 1, None, lambda *_: True)
    assert [t.polished is not None for t in found] == [True, True]
