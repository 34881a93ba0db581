"""What tolerances do, corrected by what a step of all of them did: Broyden's conditions, in closed form."""

from dataclasses import dataclass, field
from types import SimpleNamespace

import numpy as np
import pytest

from escalator_twin.diagnosis.context import Own
from escalator_twin.diagnosis.joint import JointFit, LEAST_WAY
from escalator_twin.diagnosis.polish import polish_whole, Polished

pytestmark = pytest.mark.issue(7)

N, CHANNELS = 40, 2
NAMES = ('a', 'b', 'c')
RNG = np.random.default_rng(5)
SLOPES = RNG.normal(size=(len(NAMES), N, CHANNELS))
BENT = RNG.normal(size=(N, CHANNELS))


@dataclass(frozen=True)
class Bent:
    """A stage whose model bends with the product of two tolerances."""

    machine: object
    turned: dict[str, float]
    quiet: np.ndarray = field(default_factory=lambda: np.array([1.0, 0.0]))
    observation: object = field(default_factory=lambda: SimpleNamespace(index=np.arange(7, 7 + N)))

    def run(self, deviations=()):
        assert deviations == ()
        z = [self.turned.get(k, 0.0) for k in NAMES]
        return np.tensordot(z, SLOPES, 1) + z[0] * z[1] * BENT


@dataclass(frozen=True)
class Context:
    own: Own | None
    machine: object = None


def place(turned):
    stage = Bent(None, turned)
    return SimpleNamespace(stage=stage, model=stage.run())


def at_none():
    columns = {k: (SLOPES[i] * [1.0, 0.0]).astype(np.float32) for i, k in enumerate(NAMES)}
    return JointFit(Context(Own(np.arange(7, 7 + N), columns)), (), None)


def test_along_the_step_it_is_what_was_run_and_across_it_what_it_was():
    start, end = {'a': 0.3}, {'a': 1.3, 'b': -0.8, 'c': 0.1}
    before = at_none().context.own.columns
    after = at_none().by_secant(place(start), (), end).context.own.columns
    way = np.array([end.get(k, 0.0) - start.get(k, 0.0) for k in NAMES])
    along = sum(z * after[k] for k, z in zip(NAMES, way, strict=True))
    change = (Bent(None, end).run() - Bent(None, start).run()) * [1.0, 0.0]
    np.testing.assert_allclose(along, change, atol=2e-6)
    off = np.abs(change - sum(z * before[k] for k, z in zip(NAMES, way, strict=True)))
    assert off.max() > 0.1  # the columns had not been what the step did
    for across in np.linalg.svd(way[None])[2][1:]:
        kept = sum(z * (after[k] - before[k]) for k, z in zip(NAMES, across, strict=True))
        np.testing.assert_allclose(kept, 0.0, atol=2e-6)


def test_a_step_of_next_to_nothing_and_columns_that_were_not_run_change_nothing():
    fit = at_none()
    assert fit.by_secant(place({}), (), {'a': 0.5 * LEAST_WAY}) is fit
    bare = JointFit(Context(None), (), None)
    assert bare.by_secant(place({}), (), {'a': 2.0}) is bare


def test_every_tolerance_is_run_once_and_later_steps_take_one_run(monkeypatch):
    asked = []

    def whole(self, *_):
        asked.append('whole')
        return self

    def secant(self, before, effects, turned):
        asked.append((before.level, effects, turned['a']))
        return self

    def there(level):
        return SimpleNamespace(level=level, stage=SimpleNamespace(turned={'a': level}))

    def step(_self, now, effects, _white, _jobs):
        return (there(0.5 * now.level), (*effects, 'moved')) if now.level > 200.0 else None

    monkeypatch.setattr(JointFit, 'taken_whole', whole)
    monkeypatch.setattr(JointFit, 'by_secant', secant)
    monkeypatch.setattr(JointFit, 'beside', lambda _self, _effects, turned: there(turned['a']))
    monkeypatch.setattr(JointFit, 'columns', lambda *_: None)
    monkeypatch.setattr(JointFit, 'spreads', lambda *_: ())
    monkeypatch.setattr(JointFit, 'step', step)
    monkeypatch.setattr('escalator_twin.diagnosis.polish.judged', lambda at, _: at.level)
    found = polish_whole(Polished(None, there(1000.0), (), ()), worth=10.0, steps=5)
    assert found.place.level == 125.0
    assert asked == [
        'whole',
        (1000.0, (), 500.0),
        (500.0, ('moved',), 250.0),
        (250.0, ('moved', 'moved'), 125.0),
    ]
