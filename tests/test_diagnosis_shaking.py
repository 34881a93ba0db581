"""What rattling shakes stays out of what a cause of the chain is judged by; a scale is no gauge."""

from types import SimpleNamespace

import numpy as np
import pytest
import trials

from escalator_twin.diagnosis.floor import Floor
from escalator_twin.diagnosis.grids import Frame
from escalator_twin.diagnosis.nuisance import Nuisance
from escalator_twin.diagnosis.observation import Observation
from escalator_twin.diagnosis.search_gauges import gains
from escalator_twin.diagnosis.stage import Stage
from escalator_twin.diagnosis.verdict import weigh
from escalator_twin.diagnosis.whitening import make_whitener, sensor_variance

pytestmark = pytest.mark.issue(6)

MACHINE = trials.prototype()
SENSORS = MACHINE.instruments.sensors
CHANNELS = tuple(s.channel for s in SENSORS)
FRAME = Frame.of(MACHINE, 0.5)
N = FRAME.n_loop
SHAKEN = np.array([c.endswith(('/x', '/z')) for c in CHANNELS])
FORCES = np.array([c.startswith('link_force') for c in CHANNELS])


def stage_of(measured, names=('zero',), columns=None) -> Stage:
    n, c = measured.shape
    seconds = np.arange(n) / FRAME.rate_hz
    observation = Observation(
        FRAME, CHANNELS, np.arange(n), np.repeat(seconds[:, None], c, 1), measured,
        np.ones((n, c), bool), 0.0,
    )  # fmt: skip
    whiten = make_whitener(observation, MACHINE, Floor({}))
    if columns is None:
        columns = np.ones((n, c, 1), np.float32)
    nuisance = Nuisance(tuple(names), columns.astype(np.float32))
    return Stage(
        MACHINE, SimpleNamespace(), observation, nuisance, whiten, whiten(nuisance.columns), (),
        {}, 0.0,
    )  # fmt: skip


def noise(seed: int) -> np.ndarray:
    sds = [sensor_variance(s, FRAME.rate_hz) ** 0.5 for s in SENSORS]
    return np.random.default_rng(seed).normal(0.0, sds, (N, len(CHANNELS)))


def test_rattle_does_not_count_for_a_cause_of_the_chain():
    still = np.zeros((N, len(CHANNELS)))
    quiet, rattling = noise(1), noise(1) + 9.0 * noise(2) * SHAKEN
    one, other = (stage_of(m) for m in (quiet, rattling))
    friction = [s.judged(s.fit(still), 'tensioner_friction') for s in (one, other)]
    assert friction[0] == pytest.approx(friction[1], rel=1e-5)
    step = [s.judged(s.fit(still), 'guide_step') for s in (one, other)]
    assert step[1] > 5.0 * step[0]


def test_columns_of_a_cause_of_the_chain_are_empty_where_rattling_shakes():
    stage = stage_of(noise(1))
    change = noise(3)[:, :, None]
    white = stage.columns(change, 'tensioner_preload').reshape(-1, len(CHANNELS))
    assert np.all(white[:, SHAKEN] == 0.0)
    assert np.all(np.any(white[:, ~SHAKEN] != 0.0, axis=0))
    everything = stage.columns(change, 'guide_step').reshape(-1, len(CHANNELS))
    assert np.all(np.any(everything != 0.0, axis=0))


def proposed(larger, seed=5):
    """Return the gains that are proposed where forces are larger than the machine's by shares, (c,)."""
    turns = 2.0 * np.pi * np.arange(N) / FRAME.per_pitch
    model = 4000.0 * np.sin(0.3 * turns)[:, None] * FORCES
    measured = model * (1.0 + larger) + noise(seed)
    names = tuple(f'{c}/gain' for c in CHANNELS if c.startswith('link_force'))
    columns = np.zeros((N, len(CHANNELS), len(names)))
    for k, name in enumerate(names):
        at = CHANNELS.index(name.removesuffix('/gain'))
        columns[:, at, k] = SENSORS[at].gain_tol * model[:, at]
    stage = stage_of(measured, names, columns)
    search = SimpleNamespace(
        machine=MACHINE, names=names, view=SimpleNamespace(observation=stage.observation),
        fitted=stage.fit(model), model=model, whiten=stage.whiten,
    )  # fmt: skip
    return [p for p in gains(search) if p.cause == 'gauge_gain']


def of(name):
    """Return 1 at a link's channel, 0 elsewhere, (c,)."""
    return np.array([c == f'link_force/{name}' for c in CHANNELS], float)


@pytest.mark.parametrize(
    ('alike', 'named'), [(False, True), (True, False)], ids=['one gauge', 'all forces']
)
def test_all_forces_larger_alike_is_no_gauges_gain(alike, named):
    found = proposed(0.03 * (FORCES if alike else of('left_a')))
    top = max(found, key=lambda p: p.gain)
    beyond = abs(top.parameters['factor'] - 1.0) > 3.0 * 0.003
    assert (beyond and top.gain > 25.0) == named
    if named:
        assert top.location == {'link': 'left_a'}
        assert top.parameters['factor'] == pytest.approx(1.03, abs=0.003)


@pytest.mark.parametrize(('larger', 'is_gain'), [(-0.8, True), (-1.0, False), (-2.0, False)])
def test_a_gauge_that_reads_nothing_or_the_wrong_way_has_no_gain(larger, is_gain):
    links = [p.location['link'] for p in proposed(larger * of('left_a'))]
    assert ('left_a' in links) is is_gain
    assert len(links) == 3 + is_gain


@pytest.mark.parametrize('wrong', [0.03, -0.03, -0.09])
def test_which_of_a_links_two_gauges_is_at_fault_is_told(wrong):
    """That the machine pulls otherwise on both, and the other gauge is off by as much, takes two faults."""
    best, *others = weigh([(p, p.gain) for p in proposed(wrong * of('right_b'))])
    assert best.proposal.location == {'link': 'right_b'}
    assert best.proposal.parameters['factor'] == pytest.approx(1.0 + wrong, abs=0.004)
    assert best.probability > 0.95
    assert all(other.probability < 0.01 for other in others)


def test_of_two_sides_that_are_larger_alike_neither_gauge_is_named():
    weighed = weigh([(p, p.gain) for p in proposed(0.03 * (of('left_b') + of('right_b')))])
    assert weighed[0].probability < 0.5
