"""A further effect is begun beside as much of a known one as keeps the force on the chain, where it may matter."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from escalator_twin.causes.application import apply
from escalator_twin.diagnosis import begun_afar, reach
from escalator_twin.diagnosis.afar import Afar
from escalator_twin.diagnosis.exchanges import exchanges
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.regression import fit
from escalator_twin.errors import ExperimentError
from escalator_twin.machine import load_machine
from escalator_twin.physics import run
from escalator_twin.signals import Experiment
from escalator_twin.twin import make_simulation

pytestmark = pytest.mark.issue(7)

CASE = Experiment(0.5, 1, (0.0,), 3000.0)
CHAIN, LEFT = (
    Proposal('chain_elongation', {'side': side}, {'length_m': 3e-4}, 0.0, fitted=('length_m',))
    for side in ('both', 'left')
)
PRELOAD = Proposal('tensioner_preload', {}, {'factor': 0.75}, 0.0, fitted=('factor',))
LANDING = Proposal(
    'landing_length', {'which': 'upper'}, {'delta_m': 5e-3}, 0.0, fitted=('delta_m',)
)
DRAG = Proposal('roller_drag', {'axle': 3, 'side': 'left'}, {'force_N': 120.0}, 0.0)


@pytest.fixture(scope='module')
def machine(root):
    """Return the prototype."""
    return load_machine(root / 'config' / 'machines' / 'prototype.yaml')


def tension(machine, effects):
    """Return the mean force of all links over a second, N, of the running twin."""
    simulation = make_simulation(apply(machine, tuple(e.deviation for e in effects)), CASE)
    simulation.start(0.0)
    rows = simulation.advance(1.0, 100.0, np.array([(run.EVERYTHING, 0, 0)]))
    sides, links = simulation.state.tension.shape
    # time, rack, carriage, then all tensions
    return float(rows[:, 3 : 3 + sides * links].mean())


@pytest.mark.parametrize('known', [CHAIN, PRELOAD, LANDING], ids=lambda p: p.cause)
def test_the_chain_is_held_as_before(machine, known):
    """By the running twin: to a quarter, as a polygon of longer links lets the carriage out a little farther than a line."""
    before = tension(machine, [known])
    starts = exchanges(machine, CASE, [DRAG, known])
    assert len(starts) == 2
    for back, further in starts:
        assert back[0] is DRAG
        turned = tension(machine, [known, further]) - before
        assert abs(turned) > 30.0
        assert abs(tension(machine, [back[1], further]) - before) < 0.25 * abs(turned)


def test_a_chain_of_one_side_is_turned_back_twice_as_far(machine):
    for (both, _), (left, _) in zip(
        exchanges(machine, CASE, [CHAIN]), exchanges(machine, CASE, [LEFT]), strict=True
    ):
        ways = [known[0].parameters['length_m'] - 3e-4 for known in (both, left)]
        assert ways[1] == pytest.approx(2.0 * ways[0])


@pytest.mark.parametrize(
    'known',
    [(DRAG,), (), (CHAIN, LANDING), (replace(CHAIN, parameters={'length_m': 1.9e-3}),)],
    ids=['no length', 'nothing', 'both are known', 'beyond its law'],
)
def test_where_nothing_may_be_exchanged_nothing_begins(machine, known):
    starts = exchanges(machine, CASE, known)
    # a chain that is nearly as long as its law lets it may still be shorter beside a shorter landing
    assert all(further.parameters == {'delta_m': -6e-3} for _, further in starts)
    assert len(starts) == (len(known) == 1 and known[0].cause == 'chain_elongation')


def beside(model, names=('knob',)):
    """Return a machine beside 400 samples of noise one, with a tolerance that takes their slope."""
    knob = np.linspace(-1.0, 1.0, 400)[:, None]
    fitted = fit(np.zeros(400, np.float32), knob.astype(np.float32), np.zeros(1))
    stage = SimpleNamespace(
        nuisance=SimpleNamespace(names=names),
        columns=lambda change, _: change[:, 0].astype(np.float32),
    )
    return SimpleNamespace(stage=stage, fitted=fitted, model=model)


@pytest.mark.parametrize(('excess', 'does'), [(1500.0, True), (1700.0, False)])
def test_what_changes_a_quarter_of_what_is_open_may_be_it_twice_as_large(excess, does):
    """The change is a wave of amplitude 1.414 with an energy of 400."""
    wave = np.sqrt(2.0) * np.cos(2.0 * np.pi * 5.0 * np.arange(400) / 400)[:, None]
    assert reach.reaches(beside(np.zeros((400, 1))), PRELOAD, wave, excess) is does


def test_its_own_tolerance_takes_nothing_from_an_effect():
    slope = 10.0 * np.linspace(-1.0, 1.0, 400)[:, None]
    place, own = beside(np.zeros((400, 1))), replace(PRELOAD, nuisance='knob')
    assert reach.reaches(place, own, slope, 5e4)
    assert not reach.reaches(place, PRELOAD, slope, 5e4)


@pytest.mark.parametrize(
    ('effect', 'size'),
    [
        (PRELOAD, 0.8),
        (replace(PRELOAD, parameters={'factor': 1.05}), 1.25),
        (LANDING, 6e-3),
        (replace(LANDING, parameters={'delta_m': -2e-3}), -6e-3),
    ],
)
def test_an_effect_is_as_large_as_its_reference_on_its_side(effect, size):
    (found,) = reach.at_reference(effect).parameters.values()
    assert found == pytest.approx(size)


@dataclass(frozen=True)
class Staged:
    """A stage whose machine is replaced; its run is put in by the test."""

    machine: object
    run = None


@pytest.mark.parametrize(('runs', 'large'), [(True, True), (True, False), (False, True)])
def test_only_what_runs_and_may_explain_what_is_open_is_begun(monkeypatch, machine, runs, large):
    def put_in(self, deviations):
        if not runs:
            raise ExperimentError('it stands')
        ran.append((self.machine.deviations, deviations))
        return None

    ran = []
    monkeypatch.setattr(begun_afar, 'excess_of', lambda *_: 0.0)
    monkeypatch.setattr(begun_afar, 'reaches', lambda *_: large)
    monkeypatch.setattr(begun_afar, 'fitted_afar', lambda *given: given[3])
    monkeypatch.setattr(Staged, 'run', put_in)
    setting = SimpleNamespace(experiment=CASE)
    context = SimpleNamespace(machine=machine, setting=setting, floor=None)
    place = SimpleNamespace(stage=Staged(machine), fitted=SimpleNamespace(white=np.zeros(4)))
    afar = Afar(context, place, [])
    pool = SimpleNamespace(map=map)
    begun = begun_afar.exchanged(context, afar, place, [CHAIN], pool, 1, [])
    assert len(begun) == (2 if runs and large else 0)
    for (known, one), (own, further) in zip(begun, ran, strict=bool(begun)):
        # what is run has the chain as it is turned back
        assert [known[0].deviation] == list(own)
        assert further == (one.proposal.deviation,)
