"""One run at index 0 stands for every index: against direct runs of the cause elsewhere."""

from typing import NamedTuple

import numpy as np
import pytest
import trials

from escalator_twin.diagnosis.grids import Frame
from escalator_twin.diagnosis.loops import all_probes, sensor_probes, simulate_loop
from escalator_twin.diagnosis.observation import Observation
from escalator_twin.diagnosis.responses import Responses
from escalator_twin.diagnosis.view import View
from escalator_twin.diagnosis.whitening import sensor_variance
from escalator_twin.machine import Deviation

pytestmark = pytest.mark.issue(6)

AXLE = 7


class Runs(NamedTuple):
    """The machine as described, and the change by a drag on the first axle, of everything."""

    frame: Frame
    view: View
    base: np.ndarray
    first: np.ndarray
    rack_m: float
    direction: int

    def directly(self, axle: int, side: str) -> np.ndarray:
        """Return the change of the channels by a drag on another axle, (n, c)."""
        machine = trials.prototype()
        loop = simulate_loop(
            machine, trials.case(direction=self.direction), self.frame, self.view.probes,
            (drag(axle, side),), self.rack_m,
        )  # fmt: skip
        return loop.columns - self.base


def drag(axle: int, side: str) -> Deviation:
    return Deviation('roller_drag', {'force_N': 120.0}, {'axle': axle, 'side': side})


@pytest.fixture(scope='module', params=[1, -1], ids=['up', 'down'])
def runs(request) -> Runs:
    machine, direction = trials.prototype(), request.param
    experiment = trials.case(direction=direction)
    frame = Frame.of(machine, experiment.set_speed_m_s)
    every, sensors = all_probes(), machine.instruments.sensors
    base = simulate_loop(machine, experiment, frame, every)
    first = simulate_loop(machine, experiment, frame, every, (drag(0, 'left'),), base.rack_m)
    seen = sensor_probes(sensors, frame.n_links)
    own = simulate_loop(machine, experiment, frame, seen, (), base.rack_m).columns
    n, c = frame.n_loop, len(sensors)
    observation = Observation(
        frame, tuple(s.channel for s in sensors), np.arange(n), np.zeros((n, c)),
        np.zeros((n, c)), np.ones((n, c), bool), 0.0,
    )  # fmt: skip
    responses = Responses(
        frame, base, {}, {}, {}, np.zeros((n, 1), np.complex64), {}, {},
        machine.roller.diameter_m / 2.0,
    )  # fmt: skip
    view = View.of(machine, observation, responses, direction)
    return Runs(frame, view, own, first.columns - base.columns, base.rack_m, direction)


def test_all_places_hold_what_the_sensors_see(runs):
    machine = trials.prototype()
    loop = simulate_loop(machine, trials.case(direction=runs.direction), runs.frame, all_probes())
    np.testing.assert_array_equal(runs.view.at(loop.columns), runs.base)


@pytest.mark.parametrize('side', ['left', 'right'])
def test_a_drag_elsewhere_is_the_first_ones_later(runs, side):
    direct = runs.directly(AXLE, side)
    shifted = runs.view.at(runs.first, AXLE, mirrored=side == 'right')
    for k, channel in enumerate(runs.view.observation.channels):
        sensor = trials.prototype().instruments.sensor(channel)
        rest = np.std(direct[:, k] - shifted[:, k])
        # far below what the sensor's noise lets through, data sheet
        assert rest < sensor_variance(sensor, runs.frame.rate_hz) ** 0.5, channel
        if sensor.quantity != 'step_acceleration':  # there a drag is hardly more than rounding
            assert np.corrcoef(direct[:, k], shifted[:, k])[0, 1] > 0.999, channel


def test_another_axle_is_not_the_same(runs):
    direct = runs.directly(AXLE, 'left')
    for axle in (AXLE - 1, AXLE + 1):
        shifted = runs.view.at(runs.first, axle)
        assert np.corrcoef(direct[:, 0], shifted[:, 0])[0, 1] < 0.99


def test_an_axle_stands_where_its_index_says(runs):
    # axle j stands j pitches behind axle 0 (data sheet), along the path
    pitch = trials.prototype().chain.pitch_m
    length = abs(runs.view.responses.base.length_m)
    behind = (runs.view.place_of(AXLE) - runs.view.place_of(0)) % length
    away = min(abs(behind[0] - AXLE * pitch), abs(length - behind[0] - AXLE * pitch))
    assert away < 0.5 * pitch
