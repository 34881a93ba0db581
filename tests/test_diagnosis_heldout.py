"""Gain on held-out samples: what is held out stays unseen, and a wrong extension gains nothing.

The machine is made of waves drawn here, so that what is right about it is known without a twin.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
import trials

from escalator_twin.diagnosis import scores
from escalator_twin.diagnosis.context import Beside
from escalator_twin.diagnosis.floor import Floor
from escalator_twin.diagnosis.free import creep, freed, without_own
from escalator_twin.diagnosis.heldout import folds_of, hold_out, sizes_within, slow_of
from escalator_twin.diagnosis.loops import Frame
from escalator_twin.diagnosis.nuisance import Nuisance
from escalator_twin.diagnosis.observation import Observation
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.scores import scored
from escalator_twin.diagnosis.stage import LARGEST, Stage
from escalator_twin.diagnosis.whitening import make_whitener, sensor_variance, Whitener

pytestmark = pytest.mark.issue(7)

MACHINE = trials.prototype()
CHANNELS = tuple(s.channel for s in MACHINE.instruments.sensors)
FORCES = np.array([c.startswith('link_force') for c in CHANNELS])
TENSIONER = CHANNELS.index('tensioner/displacement')
FRAME = Frame.of(MACHINE, 0.5)
GUARD = 2 * FRAME.per_pitch  # two pitches, issue 7
LOOPS = 1.75
AXLE, OTHER = 7, 30
SIZE = 20.0  # standard deviations of the sensors' noise


def effect(axle: int = AXLE) -> Proposal:
    place: dict[str, object] = {'axle': axle, 'side': 'left'}
    return Proposal('roller_drag', place, {'force_N': 120.0}, 1e4, fitted=('force_N',))


EVERYWHERE = Proposal('tensioner_friction', {}, {'force_N': 150.0}, 1e4, fitted=('force_N',))


def spread() -> np.ndarray:
    """Return the standard deviation of every channel's noise."""
    sensors = [MACHINE.instruments.sensor(c) for c in CHANNELS]
    return np.array([sensor_variance(s, FRAME.rate_hz) ** 0.5 for s in sensors])


def passing(n: int, axle: int) -> np.ndarray:
    """Return what an axle does to all forces while it passes three pitches of the loop, (n, c)."""
    place = (np.arange(n) + axle * FRAME.per_pitch) % FRAME.n_loop / FRAME.per_pitch
    bump = np.exp(-0.5 * ((place - 20.0) / 1.5) ** 2) * np.sin(2.0 * np.pi * 0.7 * place)
    return SIZE * bump[:, None] * FORCES * spread()


@dataclass(frozen=True)
class Still(Stage):
    """A stage whose machine's signals are given."""

    base: np.ndarray | None = None

    def run(self, *_):
        return self.base


@dataclass(frozen=True)
class Remembering(Whitener):
    """A whitener that keeps which samples it was shown."""

    shown: Callable[[np.ndarray], None] = print

    def __call__(self, signals):
        self.shown(self.mask[:, 0] > 0.0)
        return super().__call__(signals)


def stage_of(measured: np.ndarray, base: np.ndarray, shown=None) -> Still:
    n, c = measured.shape
    time = np.tile(np.arange(n)[:, None] / FRAME.rate_hz, (1, c))
    observation = Observation(
        FRAME, CHANNELS, np.arange(n), time, measured, np.ones((n, c), bool), 0.0
    )
    columns = np.zeros((n, c, c), np.float32)
    for k, sd in enumerate(spread()):
        columns[:, k, k] = 1e3 * sd
    whiten = make_whitener(observation, MACHINE, Floor({}))
    if shown is not None:
        whiten = Remembering(whiten.mask, whiten.weight, whiten.temperature, shown)
    nuisance = Nuisance(tuple(f'{channel}/zero' for channel in CHANNELS), columns)
    white = make_whitener(observation, MACHINE, Floor({}))(columns)
    return Still(
        MACHINE, SimpleNamespace(), observation, nuisance, whiten, white, (), {}, 0.0, base=base
    )


def recorded(seed: int = 1, loops: float = LOOPS) -> tuple[np.ndarray, np.ndarray]:
    """Return measured and simulated signals of a machine with a drag at one axle, (n, c)."""
    n = round(loops * FRAME.n_loop)
    rng = np.random.default_rng(seed)
    pitches = np.arange(n)[:, None] / FRAME.per_pitch
    base = 50.0 * spread() * np.sin(2.0 * np.pi * pitches + rng.uniform(0.0, 6.0, len(CHANNELS)))
    noise = spread() * rng.normal(size=base.shape)
    return base + passing(n, AXLE) + noise, base


def held(change: np.ndarray, proposal: Proposal, seed: int = 1, shown=None):
    measured, base = recorded(seed)
    stage = stage_of(measured, base, shown)
    after = Beside(stage, None, base + change, stage.fit(base + change))
    return hold_out(SimpleNamespace(machine=MACHINE), after, [proposal], seed)


N = round(LOOPS * FRAME.n_loop)


# the split


def test_an_effect_without_a_place_is_held_out_in_folds():
    measured, base = recorded()
    folds, split = folds_of(stage_of(measured, base), [EVERYWHERE])
    blocks = [block for fold in folds for block in fold]
    assert '12 blocks' in split
    assert len(blocks) == 12
    covered = np.zeros(N, int)
    for start, end in blocks:
        assert start % FRAME.per_pitch == 0 == end % FRAME.per_pitch
        covered[start:end] += 1
    assert covered.max() == 1  # nothing is counted twice
    assert covered.mean() > 0.9


def test_an_effect_of_one_axle_is_held_out_in_later_passages():
    measured, base = recorded()
    (blocks,), split = folds_of(stage_of(measured, base), [effect()])
    assert 'later passages' in split
    assert min(start for start, _ in blocks) >= FRAME.n_loop + GUARD
    assert max(end for _, end in blocks) <= N


def test_without_a_second_passage_the_reason_is_told():
    measured, base = recorded(loops=1.2)
    stage = stage_of(measured, base)
    found = folds_of(stage, [effect()])
    assert found[0] == []
    assert 'second passage' in found[1]
    after = Beside(stage, None, base, stage.fit(base))
    unheld = hold_out(SimpleNamespace(machine=MACHINE), after, [effect()], 1)
    assert unheld.document() is None
    assert not unheld.significant
    assert unheld.split == found[1]


@pytest.mark.parametrize('proposal', [EVERYWHERE, effect()], ids=['folds', 'later'])
def test_nothing_within_two_pitches_of_what_is_held_out_is_fitted(proposal):
    shown: list[np.ndarray] = []
    held(passing(N, AXLE), proposal, shown=shown.append)
    measured, base = recorded()
    folds, _ = folds_of(stage_of(measured, base), [proposal])
    masks = [
        mask for mask in shown if not mask.all()
    ]  # all samples: the first fit, of nothing held out
    held_out = np.zeros((len(folds), N), bool)
    for inside, blocks in zip(held_out, folds, strict=True):
        for start, end in blocks:
            inside[start:end] = True
    # what is shown of a fold's own blocks alone settles zeros and creep of the instruments there
    masks = [mask for mask in masks if not any((mask <= inside).all() for inside in held_out)]
    different = [m for k, m in enumerate(masks) if k == 0 or (m != masks[k - 1]).any()]
    assert len(different) == len(folds)
    for mask, blocks in zip(different, folds, strict=True):
        assert mask.sum() > 0.25 * N
        for start, end in blocks:
            assert not mask[max(start - GUARD, 0) : end + GUARD].any()


# the gain


@pytest.mark.parametrize('seed', range(3))
@pytest.mark.parametrize('proposal', [EVERYWHERE, effect()], ids=['folds', 'later'])
def test_a_right_extension_gains(proposal, seed):
    found = held(passing(N, AXLE), proposal, seed)
    assert found.significant
    assert found.worse == ()
    assert 0.0 < found.gain_low < found.gain_high <= 1.0
    for channel in np.array(CHANNELS)[FORCES]:
        row = found.channels[channel]
        # noise of the sensors is left, of one unit
        assert row['chi2_after'] == pytest.approx(1.0, abs=0.15)
        assert row['chi2_before'] > 4.0
        assert row['nrmse_band_after'] < row['nrmse_band_before']


@pytest.mark.parametrize('proposal', [EVERYWHERE, effect()], ids=['folds', 'later'])
def test_beside_a_gauges_creep_an_effect_of_the_machine_gains(proposal):
    measured, base = recorded()
    link = MACHINE.instruments.sensor(CHANNELS[0]).name
    numbers = {'strain': 1e-5, 'curvature': 0.0}
    drift = Proposal('gauge_drift', {'link': link}, numbers, 1e3, fitted=('strain',))
    stage = stage_of(measured, base)
    model = base + passing(N, AXLE)
    measured += creep(stage, drift)  # in place: the stage's own
    after = freed(Beside(stage, None, model, stage.fit(model)), [drift])
    found = hold_out(SimpleNamespace(machine=MACHINE), after, [proposal, drift], 1)
    assert found.significant
    assert found.channels[CHANNELS[0]]['chi2_after'] < 1.2


def test_what_a_creeping_gauge_gains_is_not_settled_away():
    measured, base = recorded()
    link = MACHINE.instruments.sensor(CHANNELS[0]).name
    numbers = {'strain': 1e-5, 'curvature': 0.0}
    drift = Proposal('gauge_drift', {'link': link}, numbers, 1e3, fitted=('strain',))
    base = base + passing(N, AXLE)
    stage = stage_of(measured, base)
    measured += creep(stage, drift)  # in place: the stage's own
    after = freed(Beside(stage, None, base, stage.fit(base)), [drift])
    found = hold_out(SimpleNamespace(machine=MACHINE), after, [drift], 1)
    assert found.significant
    row = found.channels[CHANNELS[0]]
    assert row['chi2_after'] < 1.2 < 0.1 * row['chi2_before']
    names = after.stage.nuisance.names
    assert not slow_of(after.stage, [drift])[names.index(f'{CHANNELS[0]}/zero')]
    assert slow_of(after.stage, [drift])[names.index(f'{CHANNELS[1]}/zero')]


def test_a_mean_that_counts_is_not_settled_away(monkeypatch):
    measured, base = recorded()
    stage = stage_of(measured, base)
    names = stage.nuisance.names
    zeros = [names.index(f'{channel}/zero') for channel in CHANNELS[:2]]
    monkeypatch.setattr(type(stage), 'told_by_mean', {CHANNELS[0]})
    assert slow_of(stage, [])[zeros].tolist() == [False, True]


def test_what_a_residual_is_outside_of_what_is_held_out_counts_for_nothing():
    # the zero of a gauge, settled on later passages, may be another than on the first loop
    rng = np.random.default_rng(3)
    measured, base = recorded()
    stage = stage_of(measured, base)
    every = np.ones(len(CHANNELS), bool)
    plain, better = (spread() * rng.normal(size=measured.shape) for _ in range(2))
    blocks = [slice(N // 2 + 60 * k, N // 2 + 60 * (k + 1)) for k in range(8)]
    off = better.copy()
    off[: N // 2] += 20.0 * spread()
    told = [
        scored(stage, [(block, plain, b) for block in blocks], 'later', 1, every, every)
        for b in (better, off)
    ]
    assert told[0].gain_low == pytest.approx(told[1].gain_low, abs=1e-6)
    assert told[0].gain_high == pytest.approx(told[1].gain_high, abs=1e-6)


def test_sizes_are_fitted_anew():
    # half of the effect is proposed: the size that the training blocks ask for is tried
    found = held(0.5 * passing(N, AXLE), effect())
    assert found.channels[CHANNELS[int(np.argmax(FORCES))]]['chi2_after'] < 1.15


@pytest.mark.parametrize('seed', range(5))
def test_another_axle_gains_nothing(seed):
    found = held(passing(N, OTHER), effect(OTHER), seed)
    assert not found.significant
    assert found.gain_high < 0.01


def blow(n: int, at: float) -> np.ndarray:
    """Return what one place of the guide does to one channel for a tenth of a pitch a loop, (n, c)."""
    place = np.arange(n) % FRAME.n_loop / FRAME.n_loop
    shape = np.exp(-0.5 * ((place - at) * FRAME.n_loop / (0.05 * FRAME.per_pitch)) ** 2)
    return SIZE * shape[:, None] * (np.arange(len(CHANNELS)) == TENSIONER) * spread()


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
    found = hold_out(SimpleNamespace(machine=MACHINE), after, [step], 1)
    assert not found.significant
    assert (found.channels is None) is (reason is not None)
    if reason is not None:
        assert reason in found.split


def test_a_right_name_that_harms_another_channel_is_told():
    change = passing(N, AXLE)
    change[:, TENSIONER] = 0.5 * SIZE * spread()[TENSIONER] * np.sin(0.21 * np.arange(N))
    assert CHANNELS[TENSIONER] in held(change, effect()).worse


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
    found = hold_out(SimpleNamespace(machine=MACHINE), after, [effect()], 1)
    assert found.significant
    assert found.worse == ()
    assert found.channels is not None
    assert found.channels[CHANNELS[force]]['chi2_after'] < 1.2


def test_the_bootstrap_depends_on_its_seed_alone():
    measured, base = recorded()
    stage = stage_of(measured, base)
    model = base + passing(N, AXLE)
    after = Beside(stage, None, model, stage.fit(model))
    context = SimpleNamespace(machine=MACHINE)
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
