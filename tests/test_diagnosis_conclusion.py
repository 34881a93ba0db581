"""What is told of effects of which some are not named: sizes, gain and remainder of the named ones alone."""

from types import SimpleNamespace
from typing import NamedTuple

import pytest

from escalator_twin.diagnosis import conclusion
from escalator_twin.diagnosis.found import Found
from escalator_twin.diagnosis.polish import Polished
from escalator_twin.diagnosis.proposals import Proposal

pytestmark = [pytest.mark.issue(6), pytest.mark.issue(7)]

GAINED = {'channels': {'a/b': {}}, 'worse': (), 'significant': True, 'whole_low': 0.9}


def found(cause, key, value, gain=900.0):
    return Found(
        Proposal(cause, {}, {key: value}, gain, fitted=(key,)), 0.99, {key: 0.1}, gain, ()
    )


FRICTION = found('tensioner_friction', 'force_N', 150.0)
GAUGE = found('gauge_gain', 'factor', 1.09)
STEP = found('guide_step', 'height_m', 4e-4)


HELD = SimpleNamespace(significant=True)


class Rest(NamedTuple):
    before: str
    after: str
    significant: bool = False
    explained: float = 1.0


@pytest.fixture
def concluded(monkeypatch):
    """Return what is told of effects, with what was run beside which of them."""

    def conclude(effects, probabilities, gain=None, stages=(), explained=1.0, alone=1.0):
        asked = SimpleNamespace(fitted=[], held=[], reached=[])

        def settle(*_):
            return list(zip(effects, probabilities, strict=True)), HELD

        def again(_, place, kept, __):
            asked.fitted.append((place, [e.cause for e in kept]))
            anew = [
                Proposal(e.cause, {}, {k: 2.0 * v for k, v in e.parameters.items()}, 0.0)
                for e in kept
            ]
            machine = [e for e in anew if e.cause != 'gauge_gain']
            return Polished(None, 'refitted', tuple(machine), tuple({} for _ in machine))

        def hold_out(_, after, kept, *__):
            asked.held.append((after, [e.cause for e in kept]))
            return SimpleNamespace(**GAINED | (gain or {}))

        def with_reach(_, after, rows, __):
            asked.reached.append((after, [f.proposal.cause for f in rows]))
            return rows

        monkeypatch.setattr(conclusion, 'settle', settle)
        monkeypatch.setattr(conclusion, 'hold_out', hold_out)
        monkeypatch.setattr(conclusion, 'with_reach', with_reach)
        monkeypatch.setattr(
            conclusion, 'look', lambda _, before, after: Rest(before, after, alone < 1.0, alone)
        )
        monkeypatch.setattr(
            conclusion, 'freed', lambda place, kept: f'{place}, free {[e.cause for e in kept]}'
        )
        bench = SimpleNamespace(again=again, bare=lambda place, _: place, begin=lambda *_: {})
        monkeypatch.setattr(conclusion, 'LINKED', bench)
        walked = SimpleNamespace(found=effects, before='before', after='after', stages=stages)
        rest = Rest('before', 'after', explained < 1.0, explained)
        return (*conclusion.conclude('context', walked, rest, 0, bench), asked)

    return conclude


def test_where_all_are_named_nothing_is_fitted_again(concluded):
    named, held, rest, after, asked = concluded((FRICTION, GAUGE), (0.99, 0.9))
    assert (held, rest, after) == (HELD, Rest('before', 'after'), 'after')
    assert named == [(FRICTION, 0.99), (GAUGE, 0.9)]
    assert (asked.fitted, asked.held) == ([], [])
    assert asked.reached == [('after', ['tensioner_friction', 'gauge_gain'])]


def test_sizes_gain_and_remainder_are_those_of_what_is_named(concluded):
    named, held, rest, after, asked = concluded((STEP, FRICTION, GAUGE), (0.2, 0.99, 0.9))
    kept = ['tensioner_friction', 'gauge_gain']
    assert asked.fitted == [(f'before, free {kept}', kept)]
    assert after == f'refitted, free {kept}'
    assert rest == Rest('before', after)
    assert asked.held == [(after, kept)]
    assert held.significant
    rows = [(f.proposal.cause, p, [*f.proposal.parameters.values()]) for f, p in named]
    assert rows == [
        ('tensioner_friction', 0.99, [300.0]),  # fitted anew without the step
        ('gauge_gain', 0.9, [1.09]),
        ('guide_step', 0.2, [4e-4]),
    ]
    assert asked.reached == [(after, kept)]


@pytest.mark.parametrize(
    ('probabilities', 'begun'),
    [
        ((0.99, 0.9, 0.2), 'beside two'),
        ((0.99, 0.2, 0.2), 'beside one'),
        ((0.99, 0.2, 0.9), 'before'),  # no machine had these two and no other
    ],
)
def test_the_fit_begins_where_the_tolerances_fitted_beside_what_is_named(
    concluded, probabilities, begun
):
    stages = ('before', 'beside one', 'beside two')
    *_, asked = concluded((FRICTION, GAUGE, STEP), probabilities, stages=stages)
    ((start, _),) = asked.fitted
    assert start.startswith(begun)


@pytest.mark.parametrize('gain', [{'significant': False}, {'worse': ('a/b',)}])
def test_what_gains_nothing_without_the_refused_one_is_not_named_either(concluded, gain):
    named, _, rest, _, asked = concluded((STEP, FRICTION), (0.2, 0.99), gain)
    assert max(p for _, p in named) < conclusion.NAMED
    assert rest == Rest('before', 'before')  # nothing is explained
    assert asked.reached == []


@pytest.mark.parametrize(
    ('explained', 'alone', 'expected'),
    [(1.0, 0.0, 0.0), (1.0, 0.65, 0.495), (0.65, 0.65, 0.99), (0.7, 0.75, 0.99), (1.0, 0.9, 0.99)],
)
def test_a_name_is_believed_beside_what_stays_open_with_it_alone(
    concluded, explained, alone, expected
):
    """Beside a refused step a mass left nothing open, and beside none all of it: it was told with 0.99."""
    named, *_ = concluded((STEP, FRICTION), (0.2, 0.99), explained=explained, alone=alone)
    (found,) = (p for f, p in named if f.proposal.cause == 'tensioner_friction')
    assert found == pytest.approx(expected)


def test_where_none_is_named_all_is_unexplained(concluded):
    named, held, rest, after, asked = concluded((STEP, FRICTION), (0.2, 0.3))
    assert [p for _, p in named] == [0.2, 0.3]
    assert (held, rest, after) == (HELD, Rest('before', 'before'), 'after')
    assert (asked.fitted, asked.reached) == ([], [])
