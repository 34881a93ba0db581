"""Where held-out gain is counted: which channels an effect harms, what passes once, whose noise weighs."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
from passages import (
    AXLE,
    blow,
    CHANNELS,
    effect,
    EVERYWHERE,
    FORCES,
    FRAME,
    GUARD,
    held,
    LOOPS,
    MACHINE,
    N,
    passing,
    recorded,
    SIZE,
    spread,
    stage_of,
    TENSIONER,
)
import pytest

from escalator_twin.diagnosis import scores
from escalator_twin.diagnosis.context import Beside
from escalator_twin.diagnosis.floor import Floor
from escalator_twin.diagnosis.free import freed, without_own
from escalator_twin.diagnosis.heldout import folds_of, hold_out, sizes_within
from escalator_twin.diagnosis.observation import Observation
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.scores import scored
from escalator_twin.diagnosis.stage import LARGEST
from escalator_twin.diagnosis.whitening import make_whitener

pytestmark = pytest.mark.issue(7)


@pytest.mark.parametrize(
    ('hidden', 'told', 'reason'),
    [(0.4, 0.4, 'pass once'), (0.9, 0.9, 'would show by'), (0.4, 0.5, None), (0.9, 0.5, None)],
    ids=['one event', 'not passed again', 'elsewhere', 'nothing there'],
)
def test_what_passes_once_is_told_without_a_second_look_and_refused_where_nothing_is(
    hidden, told, reason
):
    n = round(LOOPS * FRAME.n_loop)
    base = recorded()[1]
    measured = base + blow(n, hidden) + spread() * np.random.default_rng(4).normal(size=base.shape)
    model = base + blow(n, told)
    stage = stage_of(measured, base)
    after = Beside(stage, None, model, stage.fit(model))
    step = Proposal('guide_step', {'s_m': 24.4 * told}, {'height_m': 1e-3}, 1e3)
    found = hold_out(SimpleNamespace(machine=MACHINE, floor=Floor({})), after, [step], 1)
    assert not found.significant
    assert (found.channels is None) is (reason is not None)
    if reason is not None:
        assert reason in found.split


def test_a_right_name_that_harms_another_channel_is_told():
    change = passing(N, AXLE)
    change[:, TENSIONER] = 0.5 * SIZE * spread()[TENSIONER] * np.sin(0.21 * np.arange(N))
    assert CHANNELS[TENSIONER] in held(change, effect()).worse


@pytest.mark.parametrize(('above', 'is_worse'), [(0.8, False), (1.25, True)])
def test_a_channel_that_holds_no_more_than_a_good_machine_s_is_not_worse(above, is_worse):
    """Of what a good machine usually leaves there the twin knows nothing: it may rise by chance."""
    measured, base = recorded()
    stage = stage_of(measured, base)
    plain = measured - base
    harmed = plain.copy()
    harmed[:, TENSIONER] += 3.0 * spread()[TENSIONER] * np.sin(2.0 * np.pi * 0.11 * np.arange(N))
    folds, split = folds_of(stage, [EVERYWHERE])
    seen = [(slice(*block), plain, harmed) for blocks in folds for block in blocks]
    every = np.ones(len(CHANNELS), bool)
    # chi squared per coefficient of noise of one deviation and that wave, of which the floor takes no part
    level = 1.0 + 3.0**2 / 2.0
    limits = np.full(len(CHANNELS), level / above)
    found = scored(stage, seen, split, 1, every, every, limits=limits).worse
    assert (CHANNELS[TENSIONER] in found) is is_worse


def test_only_a_channel_that_an_effect_acts_on_becomes_worse_by_it():
    measured, base = recorded()
    stage = stage_of(measured, base)
    plain = measured - base
    worse = plain.copy()
    worse[:, TENSIONER] *= 1.5  # as other turns of the tolerances leave it
    folds, split = folds_of(stage, [EVERYWHERE])
    seen = [(slice(*block), plain, worse) for blocks in folds for block in blocks]
    told = []
    for acts in (True, False):
        acted = FORCES | (np.arange(len(CHANNELS)) == TENSIONER) & acts
        told.append(scored(stage, seen, split, 1, np.ones(len(CHANNELS), bool), acted).worse)
    assert told == [(CHANNELS[TENSIONER],), ()]


@pytest.mark.parametrize('waves', [('slow',), ('fast',), ('slow', 'fast')])
def test_a_channel_is_worse_where_it_is_so_as_it_is_and_over_the_floor(waves):
    """The floor here is large for slow waves: fast ones weigh thirty times as much."""
    measured, base = recorded()
    stage = stage_of(measured, base)
    weight = stage.whiten.weight.copy()
    weight[len(weight) // 2 :] *= 30.0
    stage = replace(stage, whiten=replace(stage.whiten, weight=weight))
    plain = measured - base
    added = {
        'slow': 3.0 * spread() * np.sin(2.0 * np.pi * 0.03 * np.arange(N))[:, None],
        'fast': 0.25 * spread() * np.sin(2.0 * np.pi * 0.3 * np.arange(N))[:, None],
    }
    folds, split = folds_of(stage, [EVERYWHERE])
    every = np.ones(len(CHANNELS), bool)
    better = plain + sum(added[name] for name in waves)
    seen = [(slice(*b), plain, better) for blocks in folds for b in blocks]
    found = scored(stage, seen, split, 1, every, every).worse
    quiet = CHANNELS[TENSIONER]  # what the forces hold beside is large
    assert (quiet in found) is (len(waves) == 2)


def test_a_zero_that_has_moved_later_does_not_drown_the_gain():
    measured, base = recorded()
    force = int(np.flatnonzero(FORCES)[1])
    measured[FRAME.n_loop + GUARD :, force] += 40.0 * spread()[force]
    model = base + passing(N, AXLE)
    stage = stage_of(measured, base)
    after = Beside(stage, None, model, stage.fit(model))
    found = hold_out(SimpleNamespace(machine=MACHINE, floor=Floor({})), after, [effect()], 1)
    assert found.significant
    assert found.worse == ()
    assert found.channels is not None
    assert found.channels[CHANNELS[force]]['chi2_after'] < 1.2


def test_the_bootstrap_depends_on_its_seed_alone():
    measured, base = recorded()
    stage = stage_of(measured, base)
    model = base + passing(N, AXLE)
    after = Beside(stage, None, model, stage.fit(model))
    context = SimpleNamespace(machine=MACHINE, floor=Floor({}))
    one, again, other = (hold_out(context, after, [effect()], s) for s in (1, 1, 2))
    assert one.gain_low == again.gain_low
    assert one.gain_low != other.gain_low
    bare = {'gain_low': 0.0, 'gain_high': 0.0, 'whole_low': 0.0}
    assert replace(one, **bare) == replace(other, **bare)


@pytest.mark.parametrize('acts', [0.99, 1.0])
def test_the_gain_is_counted_where_an_effect_acts(monkeypatch, acts):
    monkeypatch.setattr(scores, 'ACTS', acts)
    # everywhere else the law is wrong by a third of the noise: a draw may hold nothing but that
    wrong = 0.33 * spread() * np.sin(0.9 * np.arange(N))[:, None] * FORCES
    found = held(passing(N, AXLE) + wrong, effect())
    assert found.significant is (acts < 1.0)
    assert found.whole_low < 0.0  # over all blocks a draw may miss it in either case
    assert found.blocks == (8 if acts < 1.0 else 14)
    assert ('act in 8 of 56 blocks cut in 4' in found.split) is (acts < 1.0)


def test_the_wrong_sign_gains_nothing():
    found = held(-passing(N, AXLE), effect())
    assert not found.significant


def test_without_an_effect_a_gauge_has_a_good_gauges_gain_at_most():
    rng = np.random.default_rng(4)
    columns = rng.normal(size=(400, 3)).astype(np.float32)
    columns[:, 1] += 0.9 * columns[:, 0]  # a tolerance that does much the same
    bounded = np.array([True, False, False])
    sizes = sizes_within(columns @ np.array([30.0, 1.0, -2.0], np.float32), columns, bounded)
    assert sizes[0] == LARGEST
    # the rest takes what it can of what that leaves: least squares beside the bound
    left = columns @ np.array([30.0 - LARGEST, 1.0, -2.0])
    own = columns[:, 1:].astype(float)
    expected = np.linalg.solve(own.T @ own + np.eye(2), own.T @ left)
    np.testing.assert_allclose(sizes[1:], expected, rtol=1e-3)
    within = np.array([1.5, 1.0, -2.0], np.float32)
    np.testing.assert_allclose(sizes_within(columns @ within, columns, bounded), within, rtol=0.02)


@pytest.mark.issue(6)
def test_a_repaired_channel_weighs_by_its_own_noise():
    n, c = 400, len(CHANNELS)
    time = np.tile(np.arange(n)[:, None] / FRAME.rate_hz, (1, c))
    observation = Observation(
        FRAME, CHANNELS, np.arange(n), time, np.zeros((n, c)), np.ones((n, c), bool), 0.0
    )
    sound = make_whitener(observation, MACHINE, Floor({})).weight
    noisy = make_whitener(observation, MACHINE, Floor({}), noises={CHANNELS[0]: 2.0**0.5}).weight
    assert np.allclose(noisy[1:, 0], sound[1:, 0] / 2.0**0.5)
    assert np.array_equal(noisy[:, 1:], sound[:, 1:])


@pytest.mark.issue(7)
def test_beside_a_creeping_gauge_a_tolerance_is_left_out_as_beside_a_good_one():
    base = np.zeros((400, len(CHANNELS)))
    stage = stage_of(base, base)
    drift = Proposal('gauge_drift', {'link': 'a'}, {'strain': 1e-5, 'curvature': 0.0}, 0.0)
    after = freed(Beside(stage, None, base, stage.fit(base)), [drift]).stage
    # the effect of the machine stands for what is the first name here
    landing = Proposal(
        'landing_length', {}, {'delta_m': 6e-3}, 0.0, nuisance=stage.nuisance.names[0]
    )
    found = without_own(after, [drift, landing])
    assert found.nuisance.names == after.nuisance.names[1:]
    assert np.array_equal(found.white_nuisance, after.white_nuisance[:, 1:])
    assert np.array_equal(found.nuisance.columns, stage.nuisance.columns[:, :, 1:])
    assert found.fit(base).chi2 == 0.0
