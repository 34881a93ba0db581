"""The law's error of what shakes a step where it passes a place is carried as noise."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import fft

from escalator_twin.diagnosis import shaken
from escalator_twin.diagnosis.floor import Floor
from escalator_twin.diagnosis.nuisance import Nuisance
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.regression import fit
from escalator_twin.diagnosis.scan import as_run
from escalator_twin.diagnosis.stage import Shaken, Stage
from escalator_twin.diagnosis.trial import _refined
from escalator_twin.diagnosis.whitening import Whitener
from escalator_twin.errors import MachineError

pytestmark = pytest.mark.issue(6)

N, CHANNELS = 400, 3  # a force, and a step's x and z
QUIET = np.array([True, False, False])
PASS = slice(100, 106)


def a_bump(s_m=5.0, side='left', height_m=1e-3, length_m=0.06, cause='guide_step'):
    size = {'height_m': height_m, 'length_m': length_m}
    return Proposal(cause, {'s_m': s_m, 'side': side}, size, 0.0, {}, 1, ('height_m',))


def answer_of(deviation):
    """What a bump does: in proportion to its height; its length rolls dice at one later point."""
    change = np.zeros((N, CHANNELS))
    size = deviation.parameters['height_m'] * 1e3
    change[PASS] = np.array([1.0, 2.0, 40.0]) * size
    change[200, 2] = 30.0 if deviation.parameters['length_m'] != 0.06 else 0.0
    return change


@dataclass(frozen=True)
class Plain(Stage):
    """A stage of three channels whose machine answers as `answer_of` says."""

    @property
    def quiet(self):
        return QUIET

    @property
    def machine_length(self):
        return 24.4

    def lean(self, _):
        return self

    def run(self, deviations=(), _without=None):
        return sum((answer_of(d) for d in deviations), np.zeros((N, CHANNELS)))

    def residual(self, model):
        return self.observation.measured - model

    def fit_shifted(self, model, _):
        return self.fit(model)


def a_stage(measured, law=None):
    """Return a stage of unit noise; ``law`` is what its weights and nuisance hold of the twin's error."""
    mask = np.ones((N, CHANNELS))
    columns = np.zeros((N, CHANNELS, 1), np.float32)
    columns[0, 0] = 1.0
    names = ('zero',)
    if law is not None:
        mask = mask * law.weight
        columns = np.concatenate([columns, law.columns], axis=2)
        names = (*names, *(f'law/{k}' for k in range(law.columns.shape[2])))
    whiten = Whitener(mask, np.ones((N, CHANNELS)), 1.0)
    frame = SimpleNamespace(rate_hz=50.0)
    valid = np.ones((N, CHANNELS), bool)
    observation = SimpleNamespace(
        measured=measured, valid=valid, index=np.arange(N), frame=frame, channels=('f', 'x', 'z')
    )
    nuisance = Nuisance(names, columns)
    white = whiten(columns)
    return Plain(
        None, None, observation, nuisance, whiten, white, (), {}, 0.0, None, law
    )  # fmt: skip


def a_place(measured, law=None):
    stage = a_stage(measured, law)
    model = stage.run()
    return SimpleNamespace(stage=stage, model=model, fitted=stage.fit(model), freed=())


@pytest.fixture
def weighed_anew(monkeypatch):
    def anew(context, place):
        return a_place(place.stage.observation.measured, context.shaken)

    monkeypatch.setattr(shaken, 'weighed_anew', anew)
    monkeypatch.setattr(shaken, 'freed', lambda place, _: place)


@dataclass(frozen=True)
class AContext:
    shaken: Shaken | None = None
    floor: Floor | None = None


def noise(seed=1):
    return np.random.default_rng(seed).standard_normal((N, CHANNELS))


def test_weights_fall_where_the_answer_is_and_where_dice_are_rolled_and_nowhere_else():
    stage = a_stage(noise())
    column, power = shaken.answer(stage, stage.run(), a_bump())
    assert (power[:, 0] == 0.0).all()  # a force is as it was
    assert (column[:, 0] == 0.0).all()
    # power is averaged over eleven points: of six that hold 40 each, at the middle all
    assert power[102, 2] == pytest.approx(shaken.LAW_SHARE * 6.0 / 11.0 * 1600.0)
    assert power[200, 2] == pytest.approx(shaken.DICE * 900.0 / 11.0)
    assert power[[50, 150, 300], 2] == pytest.approx(0.0, abs=1e-20)
    # how strong it is: the law's own, and what the dice are of it
    scale = (shaken.LAW_SCALE**2 + 900.0 / (6.0 * 1604.0)) ** 0.5
    assert column[102, 2] == pytest.approx(scale * 40.0, rel=1e-3)


def test_a_machine_that_cannot_be_run_carries_nothing(monkeypatch):
    def fails(*_):
        raise MachineError('none')

    monkeypatch.setattr(Plain, 'run', fails)
    stage = a_stage(noise())
    assert shaken.answer(stage, np.zeros((N, CHANNELS)), a_bump()) is None


@pytest.mark.usefixtures('weighed_anew')
def test_each_place_is_carried_once_and_added_to_those_before():
    place = a_place(noise())
    context, there = shaken.carried(AContext(), place, [a_bump(), a_bump(side='right')])
    assert there.stage.nuisance.names == ('zero', 'law/0')
    again, same = shaken.carried(context, there, [a_bump(side='both', height_m=5e-4)])
    assert again is context
    assert same is there
    more, both = shaken.carried(context, there, [a_bump(s_m=9.0)])
    assert both.stage.nuisance.names == ('zero', 'law/0', 'law/1')
    assert (more.shaken.weight <= context.shaken.weight).all()
    own = shaken.own_law(both.stage, [a_bump(s_m=9.0, side='right')])
    assert own.tolist() == [False, False, True]
    assert not shaken.own_law(place.stage, [a_bump()]).any()


@pytest.mark.usefixtures('weighed_anew')
def test_other_causes_carry_nothing():
    place = a_place(noise())
    context = AContext()
    drag = a_bump(cause='roller_drag')
    assert shaken.carried(context, place, [drag]) == (context, place)
    weighed = shaken.weighed_for(context, place, [drag, a_bump()])
    assert weighed(drag) == (context, place)
    assert weighed(a_bump(side='both'))[0].shaken is not None
    assert weighed(a_bump(s_m=9.0)) == (context, place)


@pytest.mark.usefixtures('weighed_anew')
def test_the_law_is_fitted_where_a_bump_is_and_costs_where_none_is():
    """Weights that fall at a place are no gain by themselves: the logarithm of the variance is counted."""
    none = a_place(noise())
    context, there = shaken.carried(AContext(), none, [a_bump()])
    plain, own = (p.stage.judged(p.fitted, 'guide_step') for p in (none, there))
    log_det = -2.0 * np.log(context.shaken.weight).sum()
    lost = np.sum(noise() ** 2 * (1.0 - context.shaken.weight**2.0))
    assert own - plain == pytest.approx(log_det - lost, abs=3.0)
    assert own > plain + 10.0
    # of causes that do not shake nothing is counted
    assert there.stage.judged(there.fitted) == pytest.approx(
        none.stage.judged(none.fitted), abs=1.0
    )


@pytest.mark.usefixtures('weighed_anew')
def test_a_strength_that_the_twin_has_wrong_does_not_move_the_height():
    """A tenth more in a step's z than the twin has: forces tell the height."""
    truth = answer_of(a_bump().deviation)
    measured = noise() + truth * np.array([1.0, 1.1, 1.1])
    none = a_place(measured)
    _, there = shaken.carried(AContext(), none, [a_bump()])
    heights = np.linspace(0.8, 1.2, 81)

    def best(place):
        levels = [
            place.stage.judged(
                place.stage.fit(place.stage.run((a_bump(height_m=h * 1e-3).deviation,))),
                'guide_step',
            )
            for h in heights
        ]
        return heights[int(np.argmin(levels))]

    assert best(none) == pytest.approx(1.1, abs=0.01)
    assert abs(best(there) - 1.0) < 0.5 * abs(best(none) - 1.0) + 0.05


@pytest.mark.usefixtures('weighed_anew')
def test_gains_count_from_the_machine_without_the_law():
    bump = a_bump()
    measured = noise() + answer_of(bump.deviation)
    none = a_place(measured)
    _, there = shaken.carried(AContext(), none, [bump])
    before = none.stage.judged(none.fitted, 'guide_step')
    after = there.stage.judged(there.stage.fit(answer_of(bump.deviation)), 'guide_step')
    refined = _refined(none, there, replace(bump, fitted=('height_m',)))
    assert refined.gain == pytest.approx(before - after, rel=0.01)
    (ran,) = as_run(there.stage, there.fitted, [bump], 1, before)
    assert ran.gain == pytest.approx(before - after)
    # a place where nothing is has the same to explain, and does not explain it
    _, elsewhere = shaken.carried(AContext(), none, [a_bump(s_m=9.0)])
    assert elsewhere.stage.fit(none.model).chi2 < before


def test_along_is_the_inverse_of_what_is_weighed():
    whiten = Whitener(np.ones((N, 1)), np.full((N, 1), 0.5), 1.0)
    signal = noise()[:, :1]
    assert whiten.along(signal) == pytest.approx(0.5 * signal)
    short = Whitener(np.ones((N, 1)), np.ones((100, 1)), 1.0)  # the band's end
    waves = fft.dct(short.along(signal), axis=0, norm='ortho')
    assert np.abs(waves[100:]).max() < 1e-12


def test_a_fit_is_as_without_where_nothing_is_carried():
    stage = a_stage(noise())
    fitted = fit(stage.white(stage.run()), stage.white_nuisance)
    assert stage.whole(fitted) == fitted.chi2
