"""What effects of single links do is added to runs without them."""

from dataclasses import replace
from types import SimpleNamespace

from makers import PROTOTYPE
import numpy as np
import pytest

from escalator_twin.causes.application import apply
from escalator_twin.comparison.locate import Setting
from escalator_twin.diagnosis import fitting
from escalator_twin.diagnosis.context import Context
from escalator_twin.diagnosis.fitting import fitted_beside
from escalator_twin.diagnosis.knobs import knobs_of, RACKING, turn_all
from escalator_twin.diagnosis.leaning import leaned
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.stage import run_beside
from escalator_twin.machine import load_machine
from escalator_twin.signals import Experiment

pytestmark = pytest.mark.issue(7)

ROLLER = Proposal(
    'roller_eccentricity', {'axle': 9, 'side': 'left'},
    {'amplitude_m': 4e-4, 'phase_rad': 0.3, 'slip': 0.0}, 1e3,
    fitted=('amplitude_m', 'phase_rad', 'slip'),
)  # fmt: skip
LINK = Proposal('link_elongation', {'link': 12}, {'length_m': 3e-3}, 1e3, fitted=('length_m',))
CHAIN = Proposal(
    'chain_elongation', {'side': 'both'}, {'length_m': 1e-4}, 1e3, fitted=('length_m',)
)
PRELOAD = Proposal(
    'tensioner_preload', {}, {'factor': 0.9}, 1e2, fitted=('factor',),
    nuisance='experiment.preload_n',
)  # fmt: skip
GAUGE = Proposal('gauge_gain', {'channel': 'link_force/left_a'}, {'factor': 1.2}, 1e2)
TURNED = {'chain.link_damping_n_s_m': 1.0, 'rolling_resistance': -0.5}


@pytest.fixture(scope='module')
def context():
    machine = load_machine(PROTOTYPE)
    experiment = Experiment(0.5, 1, (40.0,), 3000.0)
    setting = Setting(experiment, 0, {}, {}, {}, 0.3, 8.0, None, None, np.inf, ())
    return Context(None, machine, setting, None, None, 0.0)


def ran(context, *effects):
    machine = apply(context.machine, tuple(e.deviation for e in effects))
    experiment = context.setting.experiment
    knobs = knobs_of(machine, experiment)
    return run_beside(*turn_all(machine, experiment, knobs, TURNED), context.setting)


@pytest.mark.parametrize('local', [ROLLER, LINK])
def test_where_they_were_fitted_nothing_is_lost(context, local):
    lean, rest = leaned(context, [GAUGE, local, CHAIN], TURNED)
    assert rest == [CHAIN]
    whole, again = ran(context, local, CHAIN), ran(lean, CHAIN)
    scale = np.abs(whole.columns).max(axis=0)
    np.testing.assert_allclose(again.columns / scale, whole.columns / scale, atol=1e-9)
    np.testing.assert_allclose(again.place_m, whole.place_m, atol=1e-9)
    assert again.rack_m == pytest.approx(whole.rack_m, abs=1e-9)


def test_a_further_effect_does_about_the_same_as_beside_them(context):
    lean, rest = leaned(context, [ROLLER], TURNED)
    assert rest == []
    alone = ran(context, ROLLER).columns
    whole = ran(context, ROLLER, PRELOAD).columns - alone
    again = ran(lean, PRELOAD).columns - alone
    left = np.sqrt(np.mean((again - whole) ** 2, axis=0) / np.mean(whole**2, axis=0))
    sensors = context.machine.instruments.sensors
    steady = [k for k, s in enumerate(sensors) if s.quantity != 'step_acceleration']
    assert len(steady) == 5
    assert max(left[steady]) < 0.1  # rollers that rattle shake steps by chance


def test_there_may_be_nothing_to_leave_out(context):
    assert leaned(context, [GAUGE, CHAIN], TURNED) is None
    lean, _ = leaned(context, [ROLLER], TURNED)
    assert leaned(lean, [ROLLER], TURNED) is None


class Fits:
    """Stands in for `polish`, and keeps what was asked for."""

    def __init__(self, chain_m):
        self.asked, self.chain_m = [], chain_m

    def __call__(self, context, effects, turned, _free, *args, **more):
        self.asked.append((context, tuple(effects), dict(turned), {'args': args, **more}))
        fitted = tuple(
            replace(e, parameters={'length_m': self.chain_m}) if e.cause == CHAIN.cause else e
            for e in effects
        )
        stage = SimpleNamespace(judged=lambda *_: 50.0, turned={'rolling_resistance': 2.0})
        place = SimpleNamespace(stage=stage, fitted=None)
        return SimpleNamespace(
            context=context, place=place, effects=fitted, sd=tuple({} for _ in effects)
        )


def test_a_rival_is_fitted_without_them_first_and_then_beside_them(context, monkeypatch):
    fits = Fits(2e-4)
    monkeypatch.setattr(fitting, 'polish', fits)
    stage = SimpleNamespace(judged=lambda *_: 90.0, turned={**TURNED, RACKING: 1.5})
    place = SimpleNamespace(stage=stage, fitted=None)
    refined = SimpleNamespace(proposal=PRELOAD, gain=10.0, sd={})
    tried = fitted_beside(context, place, [CHAIN, GAUGE, ROLLER], refined)
    (lean, first, begin, how), (whole, last, end, more) = fits.asked
    assert lean.setting.added is not None
    assert [e.cause for e in first] == [CHAIN.cause, PRELOAD.cause]
    assert begin == stage.turned
    assert not how['is_near']
    assert whole.setting is context.setting
    assert [e.cause for e in last] == [CHAIN.cause, ROLLER.cause, PRELOAD.cause]
    assert last[0].parameters['length_m'] == 2e-4
    assert end == {'rolling_resistance': 2.0, RACKING: 1.5}
    assert more['is_near']
    assert tried.gain == 40.0
    assert tried.proposal.cause == PRELOAD.cause


def test_beside_nothing_of_a_single_link_it_is_fitted_once(context, monkeypatch):
    fits = Fits(2e-4)
    monkeypatch.setattr(fitting, 'polish', fits)
    stage = SimpleNamespace(judged=lambda *_: 90.0, turned=TURNED)
    place = SimpleNamespace(stage=stage, fitted=None)
    for one, known in ((PRELOAD, [CHAIN]), (ROLLER, [LINK])):
        refined = SimpleNamespace(proposal=one, gain=10.0, sd={})
        fitted_beside(context, place, known, refined)
    assert [asked[0] for asked in fits.asked] == [context, context]
