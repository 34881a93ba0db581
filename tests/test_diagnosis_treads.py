"""Treads and rails: what a search promises, the twin run with it keeps."""

import json
from math import exp, pi
from types import SimpleNamespace

import numpy as np
import pytest
from rig.hidden import plan, write_hidden
import trials

from escalator_twin import bagfile
from escalator_twin.diagnosis import search_rails
from escalator_twin.diagnosis.floor_file import load_floor
from escalator_twin.diagnosis.preparation import prepare
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.search import Search, WORTH
from escalator_twin.diagnosis.search_rails import rail_steps
from escalator_twin.diagnosis.search_treads import (
    eccentric,
    FLAT_LEAST,
    FLAT_MOST,
    flats,
    unfolded,
)
from escalator_twin.diagnosis.view import View

pytestmark = pytest.mark.issue(6)

# By machine and cause drawn: slow, down, empty; up, empty and full; slow, up, full; down, full.
MADE = [
    pytest.param(12, 'roller_flat', flats, 'depth_m', marks=pytest.mark.long),
    (3, 'roller_flat', flats, 'depth_m'),
    pytest.param(4, 'roller_flat', flats, 'depth_m', marks=pytest.mark.long),
    pytest.param(5, 'roller_eccentricity', eccentric, 'amplitude_m', marks=pytest.mark.long),
    pytest.param(6, 'roller_eccentricity', eccentric, 'amplitude_m', marks=pytest.mark.long),
]
SEED = 60214


def searched(tmp_path, made, seed):
    """Return a search beside a recording that is made, tuned, and its effect."""
    folder = tmp_path / 'made'
    write_hidden([made], seed, folder, 1)
    bag = next(path for path in folder.iterdir() if path.is_dir() and path.name != 'truth')
    machine = trials.prototype()
    context = prepare(bagfile.read(bag, machine), machine, load_floor(machine), jobs=2)
    place = context.place
    assert place is not None
    view = View.of(
        machine, place.stage.observation, context.responses, context.setting.experiment.direction
    )
    (effect,) = json.loads((folder / 'truth' / f'{bag.name}.json').read_text())['effects']
    return Search(view, place.fitted, place.stage, place.model, 2), effect


@pytest.mark.slow
@pytest.mark.parametrize(('index', 'cause', 'family', 'key'), MADE)
def test_a_tread_is_found_with_size_and_phase_before_it_is_run(
    tmp_path, index, cause, family, key
):
    search, effect = searched(tmp_path, plan(index, SEED, 1, [cause], ('reference',)), SEED)
    best = max(family(search), key=lambda p: p.gain)
    assert best.location == effect['location']
    assert best.parameters[key] == pytest.approx(effect['parameters'][key], rel=0.25)
    # what says whether a spot is looked for at all: beside what explains as much as it does, and twice of it
    first = max(p.gain for p in eccentric(search))
    if cause == 'roller_flat':
        assert 2.0 * FLAT_LEAST * first < best.gain
        assert WORTH * best.gain < 0.5 * FLAT_MOST * first
    # a phase off by a tenth of a turn, or a slip by a twentieth of the grid's, would keep next to nothing
    stage = search.stage
    after = stage.judged(stage.fit(stage.run((best.deviation,))), cause)
    assert stage.judged(search.fitted, cause) - after == pytest.approx(best.gain, rel=0.15)


@pytest.mark.issue(7)
@pytest.mark.parametrize('sense', [1, -1], ids=['up', 'down'])
def test_orders_of_a_spot_are_told_from_fewer_phases(sense):
    # of every order a wave that changes along the loop five times as slowly as phases lie apart
    n, turns, phases, count = 4096, 64, 24, 20
    place = np.arange(n) / n
    turned = sense * 2.0 * pi * turns * place + 0.7
    rng = np.random.default_rng(8)
    slow = rng.integers(-turns * phases // 10, turns * phases // 10, (count, 2))
    size = rng.normal(size=(count, 2)) + 1j * rng.normal(size=(count, 2))
    waves = size[:, None] * np.exp(2j * pi * slow[:, None] * place[:, None])
    waves[0] = waves[0].real
    orders = waves * np.exp(1j * np.arange(count)[:, None] * turned)[:, :, None]
    phase = 2.0 * pi * np.arange(phases) / phases
    twice = np.where(np.arange(count) > 0, 2.0, 1.0)
    flats = np.real(np.einsum('h,hnc,hk->knc', twice, orders, np.exp(
        1j * np.outer(np.arange(count), phase)
    )))  # fmt: skip
    found = unfolded(flats.astype(np.float32), turned, count)
    np.testing.assert_allclose(found, orders, atol=2e-4)


@pytest.mark.long
def test_a_rails_step_is_found_where_rollers_rattle(tmp_path):
    # slow and empty: a bump a third as long does another thing, on the other side of the joint the opposite
    made = plan(13, 141101, 1, ['guide_step'], ('reference',))
    search, effect = searched(tmp_path, made, 141101)
    best = max(rail_steps(search), key=lambda p: p.gain)
    assert best.location['s_m'] == pytest.approx(effect['location']['s_m'], abs=0.02)
    assert best.location['side'] == effect['location']['side']
    # a run of another height, scaled: where a fit begins (which ends at 1.469 of 1.5 mm here)
    assert best.parameters['height_m'] == pytest.approx(effect['parameters']['height_m'], rel=0.15)


class Bumps:
    """Bumps whose gain is a function of the place nearest to what is sought, height and length."""

    def __init__(self, at, gain):
        self.sought, self.gain = at, gain
        self.search, self.length_m = SimpleNamespace(jobs=1, least=0.0), 24.4

    def at(self, place, bump, reach_m):
        near = min(max(self.sought, place - reach_m), place + reach_m)
        numbers = {'height_m': bump.height_m, 'length_m': bump.length_m}
        gain = self.gain(near - self.sought, bump.height_m, bump.length_m)
        gains = {'left': gain, 'right': 0.7 * gain, 'both': 0.0}
        return [
            Proposal('guide_step', {'s_m': near, 'side': side}, numbers, explained)
            for side, explained in gains.items()
        ]


@pytest.mark.issue(6)
@pytest.mark.parametrize(
    ('at', 'height', 'wide'),
    [(6.0, 1.5e-3, 0.065), (6.0, -1.5e-3, 0.055), (6.015, 5e-4, 0.045), (5.99, 1.3e-3, 0.07)],
)
def test_bumps_of_either_sign_and_any_length_are_run(at, height, wide):
    def gain(off, high, length):
        """Return less, the farther off a shape is."""
        return 900.0 / (
            1.0 + 50.0 * abs(off) + 1e3 * abs(high - height) + 1e2 * abs(length - wide)
        )

    known = [
        Proposal('guide_step', {'s_m': place, 'side': 'left'}, {'height_m': 1e-3}, gain)
        for place, gain in ((5.9, 40.0), (6.0, 60.0))
    ]
    found = search_rails._shapes(Bumps(at, gain), known)
    assert max(p.gain for p in found) > 820.0


@pytest.mark.parametrize('height', [1.5e-3, -1.5e-3, 5e-4])
def test_where_rollers_rattle_a_low_bump_is_tried_as_well(height):
    # what only a bump of about this height explains, as slow and empty
    bumps = Bumps(20.0, lambda _off, high, _length: 80.0 * (high == height))
    sign = -1.0 if height < 0.0 else 1.0
    found = search_rails._trial(bumps, 20.03, sign)
    best = max(found, key=lambda p: p.gain)
    assert (best.gain, best.location['s_m']) == (80.0, 20.0)


@pytest.mark.parametrize(('starts', 'at'), [([24.16, 12.0], 23.34), ([0.1], 24.0), ([6.0], 6.0)])
def test_a_bump_that_looks_best_a_pitch_or_two_off_is_followed(starts, at):
    length, pitch = 24.4, 0.41
    tried = []

    def trial(start):
        """Return what is best at a place, and falls off with every pitch from there."""
        tried.append(start)
        off = abs((start - at + 0.5 * length) % length - 0.5 * length)
        return [Proposal('guide_step', {'s_m': start}, {}, 100.0 * exp(-off))]

    trials = search_rails._followed([trial(s) for s in starts], trial, pitch, length)
    best = max((p for found in trials for p in found), key=lambda p: p.gain)
    assert best.location['s_m'] == pytest.approx(at, abs=0.1)
    assert len(tried) == len(trials) <= len(starts) + 4  # on both sides of every best one, once


def test_nothing_is_followed_where_nothing_was_tried():
    assert search_rails._followed([], None, 0.41, 24.4) == []
