"""Phases of what goes round, which each recording has its own of."""

from types import SimpleNamespace

import numpy as np
import pytest

from escalator_twin.diagnosis import walk
from escalator_twin.diagnosis.phases import rolled_here
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.regression import fit
from escalator_twin.diagnosis.suggested import Suggested

pytestmark = pytest.mark.issue(7)

TURNS = np.linspace(0.0, 40.0 * np.pi, 2000)
ROLLER = Proposal(
    'roller_eccentricity', {'axle': 9, 'side': 'left'},
    {'amplitude_m': 4e-4, 'phase_rad': 0.3, 'slip': 0.0}, 1e3,
    fitted=('amplitude_m', 'phase_rad', 'slip'),
)  # fmt: skip
CHAIN = Proposal(
    'chain_elongation', {'side': 'both'}, {'length_m': 1e-4}, 1e3, fitted=('length_m',)
)


def shake(phase, amplitude_m=4e-4):
    return amplitude_m * np.sin(TURNS + phase)[:, None] * np.array([1e4, -3e3])


def place_of(phase):
    """A recording whose roller has a phase, beside a machine without, and a course that drifts."""
    drift = np.stack([np.linspace(-1.0, 1.0, TURNS.size)] * 2, axis=1)
    noise = np.random.default_rng(4).normal(0.0, 0.2, drift.shape)

    def run(deviations):
        (one,) = deviations
        return 5.0 + shake(one.parameters['phase_rad'], one.parameters['amplitude_m'])

    stage = SimpleNamespace(
        run=run, columns=lambda stack, _cause: stack.reshape(-1, stack.shape[-1])
    )
    white = (shake(phase) + 0.7 * drift + noise).ravel()
    return SimpleNamespace(
        stage=stage, model=np.full(drift.shape, 5.0), fitted=fit(white, drift.reshape(-1, 1))
    )


@pytest.mark.parametrize('phase', [-2.8, -0.4, 1.1, 3.0])
def test_two_runs_tell_how_a_roller_stood(phase):
    told = rolled_here(place_of(phase), ROLLER)
    assert told.parameters == {**ROLLER.parameters, 'phase_rad': pytest.approx(phase, abs=0.02)}


def test_what_does_not_turn_stays_as_it_is():
    assert rolled_here(None, CHAIN) is CHAIN


def test_a_suggested_roller_is_fitted_from_the_phase_that_the_recording_has(monkeypatch):
    class EnoughError(Exception):
        """It was asked for."""

    asked = []

    def again(_context, _place, effects, _jobs):
        asked.extend(effects)
        raise EnoughError

    place = place_of(1.1)
    monkeypatch.setattr(walk, 'freed', lambda place, _: place)
    bench = SimpleNamespace(again=again)
    with pytest.raises(EnoughError):
        walk.walk(SimpleNamespace(place=place), bench=bench, suggested=Suggested((CHAIN, ROLLER)))
    assert asked[0] is CHAIN
    assert asked[1].parameters['phase_rad'] == pytest.approx(1.1, abs=0.02)
