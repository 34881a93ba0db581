"""What a machine does whose speed wanders slowly, told from one that runs at an even speed."""

from dataclasses import replace

import numpy as np
import pytest
import trials

from escalator_twin.diagnosis.floor import is_shaken
from escalator_twin.diagnosis.grids import Frame
from escalator_twin.diagnosis.loops import sensor_probes, simulate_loop
from escalator_twin.diagnosis.nuisance import make_nuisance, wander
from escalator_twin.diagnosis.observation import Observation
from escalator_twin.diagnosis.responses import Responses
from escalator_twin.diagnosis.tolerances import find_knobs, WANDER

pytestmark = pytest.mark.issue(6)

MACHINE = trials.prototype()
SENSORS = MACHINE.instruments.sensors
CHANNELS = tuple(s.channel for s in SENSORS)
QUIET = [not is_shaken(s) for s in SENSORS]
SPEED = 0.5
FRAME = Frame.of(MACHINE, SPEED)
DURATION_S = 100.0


def passed(faster, delay_s=0.0):
    """Return a recording's rows of a machine that is ``faster(t)`` times faster than its mean speed."""
    fine = np.arange(0.0, DURATION_S + 20.0, 0.01)
    travel = SPEED * (fine + np.concatenate([[0.0], np.cumsum(faster(fine))[:-1] * 0.01]))
    index = np.arange(50, round(DURATION_S * FRAME.rate_hz))
    when = np.interp(index * FRAME.spacing_m, travel, fine)
    time = np.repeat(when[:, None] + delay_s, len(CHANNELS), axis=1)
    nothing = np.zeros_like(time)
    return Observation(FRAME, CHANNELS, index, time, nothing, nothing == 0.0, 0.0)


@pytest.mark.parametrize('period_s', [32.0, 76.9, 120.0])
def test_the_wander_is_read_from_when_places_were_passed(period_s):
    def faster(t):
        return 0.002 * np.sin(2.0 * np.pi * t / period_s + 1.0)

    observation = passed(faster, delay_s=0.3)
    true = faster(observation.time_s[:, 0] - 0.3)
    found = wander(observation)
    inner = slice(len(found) // 10, -len(found) // 10)  # a spline is free at its ends
    assert found[inner] == pytest.approx(true[inner] - true.mean(), abs=2.5e-4)


def test_a_ripple_is_no_wander():
    found = wander(passed(lambda t: 0.02 * np.sin(2.0 * np.pi * 0.46 * t)))
    assert np.abs(found[len(found) // 20 : -len(found) // 20]).max() < 2e-4


@pytest.fixture(scope='module')
def experiment():
    return replace(trials.case(), set_speed_m_s=SPEED)


@pytest.fixture(scope='module')
def knobs(experiment):
    return find_knobs(MACHINE, experiment, SPEED, with_rails=False)


@pytest.mark.parametrize('share', [-0.002, 0.002])
def test_it_does_what_another_even_speed_does(experiment, knobs, share):
    seen = sensor_probes(SENSORS, MACHINE.chain.n_links)
    base = simulate_loop(MACHINE, experiment, FRAME, seen)
    faster = replace(FRAME, speed_m_s=SPEED * (1.0 + share))
    setting = replace(experiment, set_speed_m_s=faster.speed_m_s)
    run = simulate_loop(MACHINE, setting, faster, seen, origin=base.rack_m)
    change = (run.columns - base.columns)[:, QUIET]
    left = change - share * knobs[WANDER][:, QUIET]
    assert (left.std(axis=0) < 0.25 * change.std(axis=0)).all()


def test_it_is_never_an_effect_and_as_large_as_the_recording_says(knobs):
    observation = passed(lambda t: 0.002 * np.sin(2.0 * np.pi * t / 76.9))
    responses = Responses(FRAME, None, knobs, {}, {}, np.zeros((0, 0)), {}, {}, 0.04)
    model = np.zeros(observation.measured.shape)
    nuisance = make_nuisance(observation, model, responses, MACHINE)
    column = nuisance.columns[:, :, nuisance.names.index(WANDER)]
    expected = wander(observation)[:, None] * knobs[WANDER][observation.index % FRAME.n_loop]
    assert column == pytest.approx(expected)
    assert (np.abs(column[:, QUIET]).max(axis=0) > 0.0).all()
    assert not column[:, ~np.array(QUIET)].any()
