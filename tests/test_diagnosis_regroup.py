"""A load's steps beside what was found since: those that carry nothing any more are let go."""

from types import SimpleNamespace

import numpy as np
import pytest

from escalator_twin.diagnosis import accepted, regroup
from escalator_twin.diagnosis.found import Found
from escalator_twin.diagnosis.polish import Polished
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.regression import fit
from escalator_twin.diagnosis.regroup import (
    carrying,
    is_scattered,
    regrouped,
    UNEVEN_SHARE,
    unevenness,
)
from escalator_twin.diagnosis.verdict import Weighed
from escalator_twin.errors import ExperimentError

pytestmark = [pytest.mark.issue(6), pytest.mark.issue(7)]

N, M = 60, 4000
DRAG = Proposal(
    'roller_drag', {'axle': 19, 'side': 'right'}, {'force_N': 98.0}, 9e3, fitted=('force_N',)
)


def load(steps, factor=1.8):
    return Proposal(
        'load_distribution',
        {'steps': steps},
        {'load_factor': factor},
        9e4,
        fitted=('load_factor',),
    )


@pytest.fixture
def machine(monkeypatch):
    """Return steps' responses, and a drag's, which two of them look like."""
    monkeypatch.setattr(regroup, 'is_open', lambda *_: False)
    rng = np.random.default_rng(4)
    each = rng.normal(size=(M, N))
    drag = 0.5 * (each[:, 37] + each[:, 40]) + rng.normal(size=M)
    monkeypatch.setattr(regroup.View, 'of', lambda *_: SimpleNamespace(each=lambda _: each))
    monkeypatch.setattr(
        regroup.JointFit,
        'columns',
        lambda _, __, effects, ___: np.stack([drag for e in effects if e.fitted], 1),
    )
    return SimpleNamespace(each=each, drag=drag, noise=rng.normal(size=M))


def beside(left):
    """Return context and comparison of a recording with so much left, (M,)."""
    fitted = fit(left.astype(np.float32), np.zeros((M, 1), np.float32))
    stage = SimpleNamespace(observation=None, columns=lambda columns, _: columns)
    context = SimpleNamespace(
        machine=None,
        responses=SimpleNamespace(places={'load_distribution': 'of one step'}),
        setting=SimpleNamespace(experiment=SimpleNamespace(direction=1)),
        floor=None,
    )
    return context, SimpleNamespace(stage=stage, fitted=fitted)


def regrouped_beside(machine, effects, true_steps, told, drag_told=1.0):
    """Return what is regrouped where a load and a drag are there, and others are in the model."""
    left = 0.8 * machine.each[:, true_steps].sum(axis=1) + machine.drag + machine.noise
    left -= 0.8 * machine.each[:, told].sum(axis=1) + drag_told * machine.drag
    return regrouped(*beside(left), effects)


@pytest.mark.parametrize('sd', [0.0, 0.02, 0.3])
def test_loads_that_are_uneven_everywhere_are_told_from_one_load_on_some_steps(machine, sd):
    """Against closed form: of a load's own spread v beside its mean size m, v / m**2 is more."""
    rng = np.random.default_rng(7)
    steps = list(range(3, 40, 2))
    own = 0.8 + sd * rng.normal(size=len(steps))
    told = own.mean()
    left = machine.each[:, steps] @ (own - told) + 0.1 * machine.noise
    context, place = beside(left)
    effects = [DRAG, load(steps, 1.0 + told)]
    (found,) = unevenness(context, place, effects).items()
    assert found[0] == 1
    assert found[1] == pytest.approx(own.var() / told**2, rel=0.06, abs=1e-3)
    assert is_scattered(context, place, effects) is (sd > 0.1)
    # a few steps may stand for what else is there
    few = [DRAG, load(steps[:8], 1.0 + told)]
    assert not is_scattered(context, place, few)
    assert (unevenness(context, place, few)[1] > UNEVEN_SHARE) is (sd > 0.1)


@pytest.mark.parametrize('shares', [{0: 0.2, 1: 0.0}, {0: 0.0, 1: 0.2}])
def test_only_a_load_on_many_steps_is_scattered(monkeypatch, shares):
    monkeypatch.setattr(regroup, 'unevenness', lambda *_: shares)
    few, many = load([1, 4, 9]), load(list(range(3, 40, 2)))
    assert is_scattered(None, None, [few, many]) is (shares[1] > 0.1)
    assert not is_scattered(None, None, [few])


@pytest.mark.parametrize(
    ('is_open', 'closed', 'is_uneven'),
    [(True, 0.9, True), (True, 0.3, False), (False, 0.9, False)],
)
def test_steps_that_were_not_chosen_count_where_they_close_what_is_open(
    machine, monkeypatch, is_open, closed, is_uneven
):
    steps, others = [1, 7, 8, 15, 26], [2, 3, 30, 31, 32, 44]
    shares = 0.3 * np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
    left = machine.each[:, others] @ shares + 0.1 * machine.noise
    monkeypatch.setattr(regroup, 'is_open', lambda *_: is_open)
    explained = M * float(shares @ shares)  # of independent columns with unit variance
    monkeypatch.setattr(regroup, 'excess_of', lambda *_: explained / closed)
    (share,) = unevenness(*beside(left), [DRAG, load(steps)]).values()
    expected = explained / (M * 0.8**2 * len(steps)) if is_uneven else 0.0
    assert share == pytest.approx(expected, rel=0.2, abs=1e-2)


def test_what_is_no_load_on_several_steps_is_not_asked_how_even_it_is(machine):
    context, place = beside(machine.noise)
    assert unevenness(context, place, [DRAG, load([7])]) == {}


def test_steps_that_stood_in_for_a_later_effect_are_let_go(machine):
    # seed 251121, number 0: a load on 23 to 25, and a drag of 120 N fitted with 98 beside two steps too many
    told = [23, 24, 25, 37, 40]
    effects = [load(told), DRAG]
    found = regrouped_beside(machine, effects, [23, 24, 25], told, drag_told=0.2)
    assert found is not None
    assert found[0].location == {'steps': [23, 24, 25]}
    assert found[1] is DRAG


@pytest.mark.parametrize('steps', [[23, 24, 25], [23, 24, 25, 37, 40], [7]])
def test_steps_that_carry_the_load_stay(machine, steps):
    assert regrouped_beside(machine, [load(steps), DRAG], steps, steps) is None


def test_where_no_machine_runs_the_steps_stay(machine, monkeypatch):
    def ends(*_):
        raise ExperimentError('diverged')

    monkeypatch.setattr(regroup.JointFit, 'columns', ends)
    told = [23, 24, 25, 37, 40]
    assert regrouped_beside(machine, [load(told), DRAG], [23, 24, 25], told, 0.2) is None


def test_a_load_that_was_chosen_last_was_chosen_beside_all_others(machine):
    told = [23, 24, 25, 37, 40]
    assert regrouped_beside(machine, [DRAG, load(told)], [23, 24, 25], told, drag_told=0.2) is None


def test_a_step_stays_that_explains_more_than_choosing_it_costs():
    gram = 1000.0 * np.eye(N)
    right = np.zeros(N)
    right[[3, 4]] = 800.0
    for share, kept in ((0.9, [3, 4, 5]), (0.1, [3, 4])):
        right[5] = share * 800.0
        assert carrying(right, gram, [3, 4, 5]) == kept


@pytest.mark.parametrize(('level', 'is_moved'), [(900.0, True), (1100.0, False)])
def test_what_is_regrouped_stands_where_it_comes_nearer(monkeypatch, level, is_moved):
    monkeypatch.setattr(accepted, 'quiet_chi2', lambda place: place)
    first, second = load([23, 24, 37]), load([23, 24])
    found = [
        Found(first, 0.99, {}, 9e4, (Weighed(first, 9e4, 1.0, 1.0),)),
        Found(DRAG, 0.99, {}, 9e3, (Weighed(DRAG, 9e3, 1.0, 1.0),)),
    ]

    def again(_, __, effects, ___):
        return Polished('context', level, tuple(effects), ({'load_factor': 0.1}, {'force_N': 1.0}))

    before = Polished('context', 1000.0, (first, DRAG), ({}, {}))
    moved = accepted.regrouped_found(lambda *_: [second, DRAG], again, before, [], found, 1)
    assert (moved is not None) == is_moved
    if moved is not None:
        polished, (one, other) = moved
        assert polished.place == level
        assert one.proposal.location == one.rivals[0].proposal.location == {'steps': [23, 24]}
        assert one.sd == {'load_factor': 0.1}
        assert other.proposal is DRAG
