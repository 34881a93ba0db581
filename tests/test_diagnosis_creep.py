"""A gauge's creep whose shape is not known: its size and how sure, against creep made by hand."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
from passages import AXLE, CHANNELS, MACHINE, passing, recorded, stage_of
from passages import N as GRID
import pytest

from escalator_twin.diagnosis.context import Beside
from escalator_twin.diagnosis.floor import Floor
from escalator_twin.diagnosis.free import freed, without_own
from escalator_twin.diagnosis.heldout import hold_out
from escalator_twin.diagnosis.nuisance import nuisance_of
from escalator_twin.diagnosis.regression import fit, score_each
from escalator_twin.diagnosis.search_gauges import CURVATURES, gains, over_shapes
from escalator_twin.diagnosis.unexplained import is_stretched
from escalator_twin.diagnosis.verdict import weigh

pytestmark = pytest.mark.issue(6)

N, NOISE = 400, 0.05
PART = np.linspace(0.0, 1.0, N)


def creep(c):
    return PART if c == 0.0 else (1.0 - np.exp(-c * PART)) / (1.0 - np.exp(-c))


def scores(c, seed):
    """Return what each shape makes of a creep of 1, thermal drift and a zero beside it."""
    rng = np.random.default_rng(seed)
    slow = np.stack([2.0 * PART - 1.0, np.cos(2.0 * np.pi * PART), np.sin(2.0 * np.pi * PART)], 1)
    tolerated = np.column_stack([0.1 * slow, np.full(N, 1e3)])
    signal = creep(c) + 0.1 * slow @ rng.normal(size=3) + NOISE * rng.normal(size=N)
    white, columns = signal / NOISE, tolerated / NOISE
    shapes = np.stack([creep(one) for one in CURVATURES], 1) / NOISE
    return score_each(fit(white.astype(np.float32), columns), shapes.astype(np.float32))


@pytest.mark.parametrize('c', [0.7, 2.2, 3.3])
def test_the_interval_holds_the_size_whatever_the_shape(c):
    found = np.array([over_shapes(scores(c, seed)) for seed in range(40)])
    inside = np.abs(found[:, 0] - 1.0) < 1.96 * found[:, 1]
    assert inside.mean() >= 0.85


def test_a_size_whose_shape_is_open_is_less_sure_than_that_of_the_likeliest_shape():
    score = scores(2.2, 1)
    assert over_shapes(score)[1] > 1.5 * score.sd[np.argmax(score.gain)]


CREEPING = 1  # of the channels
TOLERANCE = 1e-6  # contracts.md
STEEP = 10.0 / 3.0  # of the other makers' gauges, as their law of 0.3 of a recording has it


def seen(tolerances, curvature=STEEP, seed=1):
    """Return a recording with one gauge that creeps by some tolerances, and the machine it is of."""
    measured, base = recorded(seed)
    model = base + passing(GRID, AXLE)
    part = np.linspace(0.0, 1.0, GRID)
    sensor = MACHINE.instruments.sensor(CHANNELS[CREEPING])
    shape = (1.0 - np.exp(-curvature * part)) / (1.0 - np.exp(-curvature))
    measured[:, CREEPING] += tolerances * TOLERANCE * sensor.scale * sensor.sign * shape
    stage = stage_of(measured, model)
    nuisance = nuisance_of(stage.observation, model, {}, MACHINE)
    stage = replace(stage, nuisance=nuisance, white_nuisance=stage.whiten(nuisance.columns))
    return stage, model


def proposed(stage, model):
    """Return what the search proposes for the creeping gauge, with its probability."""
    search = SimpleNamespace(
        machine=MACHINE, names=stage.nuisance.names, fitted=stage.fit(model), model=model,
        view=SimpleNamespace(observation=stage.observation), whiten=stage.whiten,
    )  # fmt: skip
    rows = [p for p in gains(search) if p.cause == 'gauge_drift']
    (top, *_) = weigh([(p, p.gain) for p in rows])
    return top


def left_in(stage, model):
    """Return the squares that the nuisance leaves."""
    return float(np.sum(stage.fit(model).left() ** 2))


@pytest.mark.parametrize('curvature', [0.7, STEEP, 7.0])
@pytest.mark.parametrize('tolerances', [1.0, -2.5])
def test_a_good_gauges_creep_leaves_nothing(tolerances, curvature):
    still = left_in(*seen(0.0))
    assert left_in(*seen(tolerances, curvature)) == pytest.approx(still, abs=6.0)


@pytest.mark.parametrize(
    ('tolerances', 'low', 'high'),
    [(2.5, 0.0, 0.05), (-3.3, 0.1, 0.9), (6.0, 0.9, 1.0), (-10.0, 0.99, 1.0)],
)
def test_what_is_more_than_a_good_gauges_is_named(tolerances, low, high):
    top = proposed(*seen(tolerances))
    sensor = MACHINE.instruments.sensor(CHANNELS[CREEPING])
    assert top.proposal.location == {'link': sensor.name}
    assert top.proposal.parameters['strain'] == pytest.approx(tolerances * TOLERANCE, rel=0.1)
    assert low <= top.probability <= high


@pytest.mark.parametrize(
    ('tolerances', 'hides'), [(0.0, False), (1.5, False), (6.0, True), (-10.0, True)]
)
def test_what_a_creep_hides_beside_other_effects_is_sought(tolerances, hides):
    """It leaves next to nothing open: that it is larger than a good gauge's says that it is there."""
    stage, model = seen(tolerances)
    assert is_stretched(Beside(stage, None, model, stage.fit(model))) is hides


def test_no_creep_is_hardly_a_candidate():
    assert proposed(*seen(0.0)).probability < 1e-3


def test_what_it_gains_is_not_taken_by_what_a_good_gauge_may_creep_by():
    stage, model = seen(8.0)
    drift = proposed(stage, model).proposal
    bare = without_own(stage, [drift])
    own = f'{CHANNELS[CREEPING]}/creep/'
    assert any(name.startswith(own) for name in stage.nuisance.names)
    assert not any(name.startswith(own) for name in bare.nuisance.names)
    after = freed(Beside(stage, None, model, stage.fit(model)), [drift])
    found = hold_out(SimpleNamespace(machine=MACHINE, floor=Floor({})), after, [drift], 1)
    assert found.significant
    row = found.channels[CHANNELS[CREEPING]]
    assert row['chi2_after'] < 1.2 < 0.5 * row['chi2_before']
