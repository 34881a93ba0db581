"""Gain on held-out samples: what is held out stays unseen, and a wrong extension gains nothing.

The machine is made of waves drawn here, so that what is right about it is known without a twin.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
from passages import (
    AXLE,
    CHANNELS,
    effect,
    EVERYWHERE,
    FORCES,
    FRAME,
    GUARD,
    held,
    MACHINE,
    N,
    OTHER,
    passing,
    recorded,
    spread,
    stage_of,
)
import pytest
from scipy.fft import dct

from escalator_twin.diagnosis.context import Beside
from escalator_twin.diagnosis.floor import Floor
from escalator_twin.diagnosis.free import creep, freed
from escalator_twin.diagnosis.heldout import (
    _precise,
    Earlier,
    folds_of,
    hold_out,
    sizes_within,
    slow_of,
)
from escalator_twin.diagnosis.nuisance import creep_of
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.scores import scored
from escalator_twin.diagnosis.whitening import Whitener

pytestmark = pytest.mark.issue(7)


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
    unheld = hold_out(SimpleNamespace(machine=MACHINE, floor=Floor({})), after, [effect()], 1)
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
    found = hold_out(
        SimpleNamespace(machine=MACHINE, floor=Floor({})), after, [proposal, drift], 1
    )
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
    found = hold_out(SimpleNamespace(machine=MACHINE, floor=Floor({})), after, [drift], 1)
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


# beside what was accepted before


@pytest.mark.parametrize('seed', range(3))
@pytest.mark.parametrize(
    ('there', 'is_gain'), [(AXLE, True), (OTHER, False)], ids=['right', 'wrong']
)
def test_a_further_effect_gains_what_the_first_does_not(there, is_gain, seed):
    # friction everywhere is known, beside the drag at an axle
    measured, base = recorded(seed)
    n = len(base)
    first = 40.0 * FORCES * spread() * np.sin(np.arange(n) / 37.0)[:, None]
    measured += first
    known = stage_of(measured, base + first)
    model = base + first + passing(n, there)
    after = Beside(known, None, model, known.fit(model))
    earlier = Earlier(MACHINE, (EVERYWHERE,))
    context = SimpleNamespace(machine=MACHINE, floor=Floor({}))
    alone = hold_out(
        SimpleNamespace(machine=None, floor=Floor({})),
        after,
        [effect(there)],
        seed,
        earlier=earlier,
    )
    assert alone.significant == is_gain
    # both together gain much, whatever the second is
    stage = stage_of(measured, base)
    both = Beside(stage, None, model, stage.fit(model))
    assert hold_out(context, both, [EVERYWHERE, effect(there)], seed).significant


@pytest.mark.parametrize('cause', ['gauge_gain', 'gauge_drift'])
def test_beside_a_known_fault_of_a_gauge_an_effect_is_held_out_with_it(cause):
    measured, base = recorded()
    link = MACHINE.instruments.sensor(CHANNELS[0]).name
    known = Proposal(cause, {'link': link}, {'strain': 1e-5, 'curvature': 0.0}, 1e3)
    if cause == 'gauge_gain':
        known = replace(known, parameters={'factor': 1.2}, nuisance=f'{CHANNELS[0]}/gain')
    stage = stage_of(measured, base)
    gain = np.zeros((*base.shape, 1), np.float32)
    gain[:, 0, 0] = 0.003 * base[:, 0]
    nuisance = replace(
        stage.nuisance,
        names=(*stage.nuisance.names, f'{CHANNELS[0]}/gain'),
        columns=np.concatenate([stage.nuisance.columns, gain], axis=2),
    )
    stage = replace(stage, nuisance=nuisance, white_nuisance=stage.whiten(nuisance.columns))
    measured[:, 0] += (0.2 * base if cause == 'gauge_gain' else creep(stage, known))[:, 0]
    model = base + passing(N, AXLE)
    after = freed(Beside(stage, None, model, stage.fit(model)), [known])
    earlier = Earlier(MACHINE, (known,))
    found = hold_out(
        SimpleNamespace(machine=None, floor=Floor({})), after, [effect()], 1, earlier=earlier
    )
    assert found.significant
    assert found.channels[CHANNELS[0]]['chi2_after'] < 1.2


def test_beside_a_known_creep_another_gauges_creep_is_held_out():
    measured, base = recorded()
    measured -= passing(N, AXLE)
    stage = stage_of(measured, base)
    drifts = []
    for k, strain in enumerate((3e-5, 4e-5)):
        name = creep_of(CHANNELS[k])
        column = np.zeros((*base.shape, 1), np.float32)
        column[:, k, 0] = np.linspace(-1.0, 1.0, N)
        nuisance = replace(
            stage.nuisance,
            names=(*stage.nuisance.names, f'{name}1.5'),
            columns=np.concatenate([stage.nuisance.columns, column], axis=2),
        )
        stage = replace(stage, nuisance=nuisance, white_nuisance=stage.whiten(nuisance.columns))
        where = {'link': MACHINE.instruments.sensor(CHANNELS[k]).name}
        sizes = {'strain': strain, 'curvature': 2.0}
        drifts.append(Proposal('gauge_drift', where, sizes, 1e3, nuisance=name))
        measured[:, k] += creep(stage, drifts[k])[:, k]
    stage = replace(stage, observation=replace(stage.observation, measured=measured))
    after = freed(Beside(stage, None, base, stage.fit(base)), drifts)
    earlier = Earlier(MACHINE, (drifts[0],))
    found = hold_out(
        SimpleNamespace(machine=None, floor=Floor({})), after, [drifts[1]], 1, earlier=earlier
    )
    assert found.significant
    assert found.channels[CHANNELS[0]]['chi2_after'] < 1.2
    assert found.channels[CHANNELS[1]]['chi2_after'] < 1.2


def test_what_is_fitted_to_a_part_of_the_samples_is_what_dense_double_precision_fits():
    rng = np.random.default_rng(4)
    n, waves = 1200, 900
    time = np.arange(n) / 50.0
    wave = np.sin(2.0 * np.pi * 1.3 * time)[:, None]
    zero = np.full((n, 1), 1e6)  # a thousand times a signal of 1 kN
    columns = np.stack([zero, 50.0 * wave], axis=2).astype(np.float32)
    weight = np.full((waves, 1), 0.5, np.float32)
    whiten = Whitener(np.ones((n, 1), np.float32), weight, 1.0)
    keep = np.ones(n, bool)
    keep[400:700] = False
    residual = 3.0 + 20.0 * wave + rng.normal(size=(n, 1))

    def white(signals):
        return 0.5 * dct(signals.astype(np.float64) * keep[:, None], axis=0, norm='ortho')[:waves]

    dense, right = white(columns[:, 0]), white(residual)[:, 0]
    truth = np.linalg.solve(dense.T @ dense + np.eye(2), dense.T @ right)
    precise = _precise(SimpleNamespace(whiten=whiten), keep)
    everywhere = np.zeros(2, bool)
    found = sizes_within(precise(residual[:, :, None])[:, 0], precise(columns), everywhere)
    assert found == pytest.approx(truth, rel=1e-7)  # in single precision it is off by 7e-7
