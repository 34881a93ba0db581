"""Tuning on, beside what the rail does where a tuning has led: as long as a turn takes a good part of chi squared."""

from types import SimpleNamespace

import pytest

from escalator_twin.diagnosis import preparation, tuning
from escalator_twin.diagnosis.context import Context
from escalator_twin.diagnosis.descent import Descent

pytestmark = pytest.mark.issue(6)

NOTHING = SimpleNamespace(knobs=None)


def at(chi2):
    stage = SimpleNamespace(judged=lambda fitted, _=None: fitted, turned={'chi2': chi2}, lean=id)
    return SimpleNamespace(stage=stage, model=None, fitted=chi2)


@pytest.mark.parametrize(
    ('promised', 'held', 'ends'),
    [
        ([9e3, 8.9e3], [8e3], 8e3),  # a second turn promises too little
        ([9e3, 7e3, 6.8e3], [8e3, 6.9e3], 6.9e3),
        ([9.9e3], [], 1e4),  # so does the first
        ([9e3], [9.9e3], 1e4),  # what it promised does not hold with rail and alignment anew
        ([9e3, 7e3, 6e3, 5e3], [8e3, 7e3, 6e3, 5e3], 6e3),  # three times at most
    ],
)
def test_it_goes_on_while_a_turn_promises_a_good_part_that_holds(
    monkeypatch, promised, held, ends
):
    promised, held, kicks = iter(promised), iter(held), []

    class Search(Descent):
        def __init__(self, *_):
            """Search nothing."""

        def at(self, turned, _cut_hz=None):
            return at(turned['chi2'])

        def descend(self, turned, _cut_hz=None):
            return turned, 0.0, at(turned['chi2'])

        def kicked(self, start, by):
            kicks.append(by)
            level = next(promised) if by == tuning.KICKS[0] else start.fitted
            return {'chi2': level}, level

    monkeypatch.setattr(tuning, 'Descent', Search)
    monkeypatch.setattr(tuning, 'with_own_tolerances', lambda *given: given[3])
    monkeypatch.setattr(tuning, 'beside', lambda *_, **__: at(next(held)))
    context, place = tuning.tuned_on('as it was', at(1e4))
    assert place.fitted == ends
    assert (context == 'as it was') == (ends == 1e4)  # else what tolerances do there
    assert kicks[0] == tuning.KICKS[0]


@pytest.mark.parametrize('is_open', [True, False])
def test_a_recording_is_tuned_on_where_something_stays_open(monkeypatch, is_open):
    context = Context(
        None, None, SimpleNamespace(experiment=None, start_s_m=0.0), NOTHING, 'floor', 0.0
    )
    tuned = at(1e4)
    monkeypatch.setattr(preparation, 'prepare_tolerances', lambda *_: context)
    monkeypatch.setattr(preparation, 'beside', lambda *_, **__: at(2e4))
    monkeypatch.setattr(preparation, '_weak', lambda _: frozenset())
    monkeypatch.setattr(preparation, 'tuned', lambda given, **_: (given, tuned))
    monkeypatch.setattr(preparation, 'tuned_on', lambda given, _place, _jobs: (given, at(8e3)))
    monkeypatch.setattr(preparation, 'is_open', lambda place, *_: is_open and place is tuned)
    for name in ('knobs_of', 'find_responses'):
        monkeypatch.setattr(preparation, name, lambda *_: None)
    monkeypatch.setattr(preparation, 'turn_all', lambda *_: (None, None))
    found = preparation.prepare(None, None, 'floor')
    assert found.place.fitted == (8e3 if is_open else 1e4)
