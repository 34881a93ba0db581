"""A cause sought afar may be that of a known effect: two effects then stand for one tolerance."""

from types import SimpleNamespace

import numpy as np
import pytest

from escalator_twin.diagnosis import polish
from escalator_twin.diagnosis.joint import JointFit
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.regression import fit

pytestmark = pytest.mark.issue(6)

SPRING = 'tensioner.stiffness_n_m'
KNOWN = Proposal(
    'tensioner_stiffness', {}, {'factor': 1.08}, 1.6e3, fitted=('factor',), nuisance=SPRING
)
AGAIN = Proposal(
    'tensioner_stiffness', {}, {'factor': 0.9}, 225.0, fitted=('factor',), nuisance=SPRING
)


def place():
    random = np.random.default_rng(3)
    names = ('chain.mass_per_pitch_kg', SPRING, 'course')
    columns = random.normal(size=(40, 3)).astype(np.float32)
    fitted = fit(random.normal(size=40).astype(np.float32), columns, np.array([0.3, 0.0, 0.1]))
    stage = SimpleNamespace(
        nuisance=SimpleNamespace(names=names),
        knobs=(),
        turned={},
        tolerances={SPRING: 0.02},
        judged=lambda *_: 1e4,
    )
    return SimpleNamespace(stage=stage, fitted=fitted)


def test_a_fit_of_both_leaves_the_tolerance_out_once():
    # it had ended the diagnosis of a good machine (seed 251117, number 25)
    here = place()
    context = SimpleNamespace(own=None)
    white = np.random.default_rng(4).normal(size=(40, 2)).astype(np.float32)
    one, two = (
        JointFit(context, (), None).products(here, effects, white)
        for effects in ((KNOWN,), (KNOWN, AGAIN))
    )
    assert np.array_equal(one[0], two[0])
    assert np.array_equal(one[1], two[1])


def test_the_later_one_takes_the_turned_tolerance_over():
    class Fit:
        def tuned(self, *_):
            return {SPRING: 2.0}, 1e3

        def taken_anew(self, *_):
            return self

        def beside(self, *_):
            return SimpleNamespace(stage=SimpleNamespace(judged=lambda *_: 1e3), fitted=None)

    _, _, effects = polish.approach(Fit(), place(), (KNOWN, AGAIN))
    assert [e.parameters['factor'] for e in effects] == pytest.approx([1.08, 0.9 * 1.04])
