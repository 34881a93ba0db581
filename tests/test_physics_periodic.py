"""One pitch of a uniform machine against the same machine run at length."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trials

from escalator_twin.diagnosis.floor import is_shaken
from escalator_twin.diagnosis.grids import band_limited
from escalator_twin.machine import Deviation, load_machine, Machine
from escalator_twin.physics.periodic import is_uniform, run_periodic
from escalator_twin.physics.rollout import Simulation
from escalator_twin.signals import Experiment
from escalator_twin.twin import make_folded, make_simulation, run_twin

pytestmark = pytest.mark.issue(6)

WHEEL = Path(__file__).parents[1] / 'config' / 'machines' / 'prototype_wheel.yaml'
START_M, DURATION_S, RATE_HZ = 7.3, 12.0, 200.0

GUIDE_STEP = Deviation('guide_step', {'height_m': 1.5e-3}, {'s_m': 5.0, 'side': 'left'})
FRICTION = Deviation('tensioner_friction', {'force_N': 150.0})
LONGER = Deviation('chain_elongation', {'length_m': 1.5e-4}, {'side': 'left'})
ALIKE = {'as described': (), 'friction': (FRICTION,), 'longer': (LONGER,), 'step': (GUIDE_STEP,)}
UNLIKE = {
    'link': Deviation('link_elongation', {'length_m': 3e-3}, {'link': 4}),
    'roller': Deviation('roller_drag', {'force_N': 120.0}, {'axle': 3, 'side': 'left'}),
    'tread': Deviation(
        'roller_eccentricity', {'amplitude_m': 4e-4, 'phase_rad': 0.0}, {'axle': 3, 'side': 'left'}
    ),
    'load': Deviation('load_distribution', {'load_factor': 0.0}, {'steps': [3, 4]}),
    'ripple': Deviation('drive_ripple', {'relative_amplitude': 0.02, 'cycles_per_pitch': 0.37}),
}  # fmt: skip


def simulation(machine: Machine, experiment: Experiment) -> Simulation:
    built = make_simulation(machine, experiment)
    assert isinstance(built, Simulation)
    return built


def with_deviations(*deviations: Deviation) -> Machine:
    return replace(trials.prototype(), deviations=deviations)


def machine_of(name: str) -> Machine:
    # seats of a wheel lie further apart than a pitch: time goes by seats, travel by pitches
    return load_machine(WHEEL) if name == 'wheel' else with_deviations(*ALIKE[name])


@pytest.mark.parametrize('direction', [1, -1], ids=['up', 'down'])
@pytest.mark.parametrize('name', [*ALIKE, 'wheel'])
def test_one_pitch_stands_for_a_long_run(name, direction):
    machine, experiment = machine_of(name), trials.case(direction=direction)
    sensors = machine.instruments.sensors
    args = sensors, START_M, DURATION_S, RATE_HZ
    long = run_twin(simulation(machine, experiment), *args)
    short = run_periodic(simulation(machine, experiment), *args)
    assert short is not None
    assert short.columns.shape == long.columns.shape
    # a run is begun to within half a step's way, 0.25 mm
    np.testing.assert_allclose(short.place_m, long.place_m, atol=3e-4)
    spacing = machine.chain.pitch_m
    apart = (short.rack_m - long.rack_m + spacing / 2.0) % spacing - spacing / 2.0
    assert abs(apart) < 3e-4
    long_band, short_band = (band_limited(t.columns, RATE_HZ) for t in (long, short))
    rest = np.std(short_band - long_band, axis=0)
    # what half a time step's way changes: a tenth of what lies between two samples
    late = 0.1 * np.std(np.diff(long_band, axis=0), axis=0)
    for k, sensor in enumerate(sensors):
        # rollers rattle along the step: two runs differ there by chance
        share = 0.05 if is_shaken(sensor) else 0.01
        noise = 0.01 * sensor.noise * abs(sensor.scale)  # where a signal hardly moves
        assert rest[k] <= share * np.std(long_band[:, k]) + late[k] + noise, sensor.channel


def test_sides_alike_are_run_as_one():
    machine, experiment = with_deviations(UNLIKE['link'], UNLIKE['ripple']), trials.case()
    both = make_simulation(machine, experiment, step_s=1e-3)
    folded = make_folded(machine, experiment, 1e-3)
    assert (both.parameters.n_sides, folded.parameters.n_sides) == (2, 1)
    args = machine.instruments.sensors, START_M, 4.0, RATE_HZ
    apart = run_twin(both, *args).columns - run_twin(folded, *args).columns
    for k, sensor in enumerate(machine.instruments.sensors):
        assert np.abs(apart[:, k]).max() <= 0.01 * sensor.noise * abs(sensor.scale), sensor.channel


@pytest.mark.parametrize('unlike', [GUIDE_STEP, LONGER, UNLIKE['roller'], UNLIKE['tread']])
def test_sides_unlike_each_other_are_run_as_two(unlike):
    folded = make_folded(with_deviations(unlike), trials.case(), 1e-3)
    assert folded.parameters.n_sides == 2


@pytest.mark.parametrize('name', UNLIKE)
def test_a_machine_with_one_part_unlike_the_others_is_run_at_length(name):
    machine, experiment = with_deviations(UNLIKE[name]), trials.case(load=75.0)
    built = simulation(machine, experiment)
    assert not is_uniform(built.parameters)
    assert run_periodic(built, machine.instruments.sensors, START_M, DURATION_S, RATE_HZ) is None


def test_a_load_of_its_own_on_a_step_is_no_uniform_machine():
    loads = [75.0] * 60
    assert is_uniform(simulation(trials.prototype(), trials.case(load=75.0)).parameters)
    loads[7] = 0.0
    experiment = replace(trials.case(), load_per_step_kg=tuple(loads))
    assert not is_uniform(simulation(trials.prototype(), experiment).parameters)
