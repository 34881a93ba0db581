"""The simulations of diagnosis: their time step, and what is run in place of a whole machine."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
import trials

from escalator_twin.diagnosis.context import Context, with_own_tolerances
from escalator_twin.diagnosis.floor import Floor
from escalator_twin.diagnosis.grids import band_limited, Begin, Frame, rack_shift
from escalator_twin.diagnosis.joint import JointFit
from escalator_twin.diagnosis.knobs import knobs_of
from escalator_twin.diagnosis.loops import (
    all_probes,
    built,
    sensor_probes,
    simulate_loop,
    simulate_rails,
)
from escalator_twin.diagnosis.nuisance import Nuisance
from escalator_twin.diagnosis.observation import Observation
from escalator_twin.diagnosis.preparation import start_in
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.rails import draw_rails
from escalator_twin.diagnosis.responses import Responses
from escalator_twin.diagnosis.stage import run_beside, Stage
from escalator_twin.diagnosis.whitening import make_whitener
from escalator_twin.machine import Deviation
from escalator_twin.physics.periodic import run_periodic
from escalator_twin.twin import make_simulation, run_twin

pytestmark = pytest.mark.issue(6)

RATE_HZ, DURATION_S, START_M = 200.0, 24.0, 7.3
DRAG = Deviation('roller_drag', {'force_N': 120.0}, {'axle': 3, 'side': 'left'})
OTHER = Deviation('roller_drag', {'force_N': 60.0}, {'axle': 30, 'side': 'right'})
FRICTION = Deviation('tensioner_friction', {'force_N': 60.0})
LANDING = Deviation('landing_length', {'delta_m': 7e-3}, {'which': 'upper'})
LONGER = Deviation('chain_elongation', {'length_m': 1.5e-4}, {'side': 'both'})
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


def stage_with(*deviations: Deviation, direction: int = 1) -> Stage:
    machine = replace(trials.prototype(), deviations=deviations)
    frame = Frame.of(machine, 0.5)
    n, c = round((DURATION_S - 4.0) * frame.rate_hz), len(SENSORS)
    setting = SimpleNamespace(
        experiment=trials.case(direction=direction), start_s_m=START_M, duration_s=DURATION_S
    )
    base = simulate_loop(trials.prototype(), setting.experiment, frame, all_probes())
    start_m = start_in(setting, SimpleNamespace(frame=frame, base=base))
    index = np.arange(n) + round(start_m / frame.spacing_m + 2.0 * frame.rate_hz)
    observation = Observation(
        frame, tuple(s.channel for s in SENSORS), index, np.zeros((n, c)), np.zeros((n, c)),
        np.ones((n, c), bool), start_m,
    )  # fmt: skip
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


PRELOAD = Proposal('tensioner_preload', {}, {'factor': 1.25}, 0.0, fitted=('factor',))
FRAME = Proposal(
    'truss_resonance', {}, {'frequency_hz': 7.0, 'damping_ratio': 0.02, 'modal_mass_kg': 4500.0}, 0.0,
    fitted=('frequency_hz', 'damping_ratio', 'modal_mass_kg'),
)  # fmt: skip


@pytest.mark.parametrize(
    ('effect', 'least', 'most'), [(PRELOAD, 0.0, 0.1), (FRAME, 0.5, 1.5)], ids=['preload', 'frame']
)
def test_slopes_are_taken_beside_a_soft_link(effect, least, most):
    """Without it a run is one of a pitch; but where the pitch leaves a frame at rest, such a link excites it."""
    soft = Proposal('link_stiffness', {'link': 3, 'side': 'left'}, {'factor': 0.6}, 0.0)
    fit = JointFit(SimpleNamespace(machine=trials.prototype(), own=None), (), None)
    beside, alone = (
        fit.columns(SimpleNamespace(stage=stage, model=stage.run()), effects)
        for effects in ((soft, effect), (effect,))
        for stage in [stage_with(*(e.deviation for e in effects))]
    )
    for one, other in zip(beside.T, alone.T, strict=True):
        assert least < np.linalg.norm(one - other) / np.linalg.norm(one) < most


def alike(one, other, channels=FORCES):
    """Return the least correlation of two changes, (n, c), over some channels."""
    pairs = zip(one[:, channels].T, other[:, channels].T, strict=True)
    return min(np.corrcoef(a, b)[0, 1] for a, b in pairs)


@pytest.mark.parametrize('deviation', [LANDING, LONGER], ids=['landing', 'chain'])
def test_a_rail_acts_on_a_longer_loop_where_a_run_beside_the_recording_has_it(deviation):
    """Such a machine comes to the place where the recording begins some millimetres later."""
    stage = stage_with(deviation)
    machine, experiment, frame = stage.machine, stage.setting.experiment, stage.observation.frame
    rail = 0.3 * draw_rails(machine, 1)[0]
    simulation = built(machine, experiment)
    simulation.lay(rail)
    laid = run_periodic(simulation, SENSORS, START_M, DURATION_S, RATE_HZ)
    change = stage.on_grid(laid) - stage.run()
    seen = sensor_probes(SENSORS, frame.n_links)
    begin = Begin(START_M, stage.observation.start_m)
    same = simulate_loop(machine, experiment, frame, seen, origin=begin).rack_m
    assert rack_shift(same, stage.origin, frame.pitch_m) == pytest.approx(0.0, abs=1e-4)
    for origin in (begin, stage.origin):
        loop = simulate_rails(machine, experiment, frame, seen, [rail], origin=origin)[0]
        assert alike(loop[stage.observation.index % frame.n_loop], change) > 0.99


@pytest.mark.parametrize('direction', [1, -1], ids=['up', 'down'])
def test_tolerances_act_on_a_longer_loop_where_a_run_beside_the_recording_has_them(direction):
    stage = stage_with(LANDING, direction=direction)
    machine, setting = trials.prototype(), stage.setting
    frame = stage.observation.frame
    base = simulate_loop(machine, setting.experiment, frame, all_probes())
    none = np.zeros((0, 0), np.complex64)
    responses = Responses(frame, base, {}, {}, {}, none, {}, {}, machine.roller.diameter_m / 2.0)
    context = Context(None, machine, setting, responses, Floor({}), stage.observation.start_m)
    whole = replace(stage, knobs=knobs_of(stage.machine, setting.experiment))
    name = 'experiment.preload_n'
    change = replace(whole, turned={name: 2.0}).run() - stage.run()
    weak = frozenset(knob.name for knob in whole.knobs) - {name}
    for origin in (None, stage.origin):
        near = with_own_tolerances(
            replace(context, weak=weak), (LANDING,), with_rails=False, origin=origin
        )
        column = near.responses.knobs[name][stage.observation.index % frame.n_loop]
        assert alike(column, change) > 0.99


@pytest.mark.parametrize('direction', [1, -1], ids=['up', 'down'])
@pytest.mark.parametrize('others', [(), (DRAG,)], ids=['one pitch for all', 'at length'])
def test_a_loop_begins_where_a_recording_does(direction, others):
    stage = stage_with(LANDING, *others, direction=direction)
    frame, start = stage.observation.frame, stage.observation.start_m
    seen = sensor_probes(SENSORS, frame.n_links)
    experiment = stage.setting.experiment
    loop = simulate_loop(stage.machine, experiment, frame, seen, origin=Begin(START_M, start))
    place = np.interp(start, np.arange(frame.n_loop) * frame.spacing_m, loop.place_m)
    assert place % abs(loop.length_m) == pytest.approx(START_M, abs=1e-3)
    assert rack_shift(loop.rack_m, stage.origin, frame.pitch_m) == pytest.approx(0.0, abs=1e-3)
    again = simulate_loop(stage.machine, experiment, frame, seen, origin=loop.rack_m)
    np.testing.assert_allclose(again.columns, loop.columns, atol=0.05)
