"""The simulations of diagnosis: their time step, and what is run in place of a whole machine."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
import trials

from escalator_twin.diagnosis.floor import Floor
from escalator_twin.diagnosis.loops import band_limited, built, Frame, rack_shift
from escalator_twin.diagnosis.nuisance import Nuisance
from escalator_twin.diagnosis.observation import Observation
from escalator_twin.diagnosis.stage import run_beside, Stage
from escalator_twin.diagnosis.whitening import make_whitener
from escalator_twin.machine import Deviation
from escalator_twin.twin import make_simulation, run_twin

pytestmark = pytest.mark.issue(6)

RATE_HZ, DURATION_S, START_M = 200.0, 24.0, 7.3
DRAG = Deviation('roller_drag', {'force_N': 120.0}, {'axle': 3, 'side': 'left'})
OTHER = Deviation('roller_drag', {'force_N': 60.0}, {'axle': 30, 'side': 'right'})
FRICTION = Deviation('tensioner_friction', {'force_N': 60.0})
SENSORS = trials.prototype().instruments.sensors
FORCES = np.array([s.quantity == 'link_force' for s in SENSORS])
SETTLED = slice(200, -200)  # the filter's ends


def test_forces_are_those_of_a_short_step_within_the_gauges_noise():
    """A link's force, 0 to 20 Hz: issue 3 asks for 3 N rms and 15 N at most."""
    machine = replace(trials.prototype(), deviations=(DRAG,))
    experiment = trials.case()
    args = SENSORS, START_M, DURATION_S, RATE_HZ
    rough = run_twin(built(machine, experiment), *args)
    exact = run_twin(make_simulation(machine, experiment, step_s=2.5e-4), *args)
    late = rack_shift(exact.rack_m, rough.rack_m, machine.chain.pitch_m) / 0.5
    there = CubicSpline(exact.time_s, band_limited(exact.columns, RATE_HZ))(exact.time_s - late)
    apart = (band_limited(rough.columns, RATE_HZ) - there)[SETTLED]
    assert np.std(apart[:, FORCES], axis=0).max() < 1.5
    assert np.abs(apart[:, FORCES] - apart[:, FORCES].mean(axis=0)).max() < 15.0


def stage_with(*deviations: Deviation) -> Stage:
    machine = replace(trials.prototype(), deviations=deviations)
    frame = Frame.of(machine, 0.5)
    n, c = round((DURATION_S - 4.0) * frame.rate_hz), len(SENSORS)
    index = np.arange(n) + round(2.0 * frame.rate_hz)
    observation = Observation(
        frame, tuple(s.channel for s in SENSORS), index, np.zeros((n, c)), np.zeros((n, c)),
        np.ones((n, c), bool), 0.0,
    )  # fmt: skip
    setting = SimpleNamespace(experiment=trials.case(), start_s_m=START_M, duration_s=DURATION_S)
    whiten = make_whitener(observation, machine, Floor({}))
    nuisance = Nuisance(('zero',), np.ones((n, c, 1), np.float32))
    rack = run_beside(machine, setting.experiment, setting).rack_m
    return Stage(
        machine, setting, observation, nuisance, whiten, whiten(nuisance.columns), (), {}, rack
    )


@pytest.mark.parametrize('further', [FRICTION, OTHER], ids=['friction', 'drag'])
def test_a_further_effect_does_the_same_beside_one_of_a_single_axle(further):
    stage = stage_with(DRAG)
    model = stage.run()
    lean = stage.lean(model)
    assert lean.machine.deviations == ()
    np.testing.assert_allclose(lean.run(), model, atol=1e-9)
    change = (stage.run((further,)) - model)[:, FORCES]
    apart = (lean.run((further,)) - model)[:, FORCES] - change
    assert np.std(apart) < 0.2 * np.std(change)


def test_a_machine_of_like_links_is_lean_as_it_is():
    stage = stage_with(FRICTION)
    assert stage.lean(np.zeros(stage.observation.measured.shape)) is stage
