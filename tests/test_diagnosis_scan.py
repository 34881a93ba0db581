"""Variants of a proposal, each run, and a dragging stretch's ends: against signals made by hand."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from escalator_twin.diagnosis.observation import Observation
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.regression import fit
from escalator_twin.diagnosis.scan import best_variant
from escalator_twin.diagnosis.stretches import best_stretch
from escalator_twin.errors import ExperimentError

pytestmark = pytest.mark.issue(6)

PITCH, LENGTH, N, RATE = 0.4, 8.0, 4000, 50.0
TRAVEL = np.linspace(0.0, LENGTH, N)


def pulls(start, end):
    """Return the force of a drag on one roller, shaken as it enters and leaves."""
    total = ((start < TRAVEL) & (end > TRAVEL)).astype(float)
    for place in (start, end):
        way = TRAVEL - place
        shaken = np.exp(-way / 0.1) * np.sin(2.0 * np.pi * way / 0.03)
        total += np.where(way > 0.0, shaken, 0.0)
    return total


@dataclass(frozen=True)
class Toy:
    """A stage whose runs are made by hand: a drag's pull, its size times the unit one."""

    observation: Observation
    cut_hz: float | None = None
    machine_length: float = LENGTH

    def run(self, deviations):
        place = deviations[0].location
        if place['s_from_m'] > 7.0:
            raise ExperimentError('no such machine')
        force = deviations[0].parameters['force_N']
        return force * pulls(place['s_from_m'], place['s_to_m'])[:, None]

    def columns(self, changes, _):
        return self._white(changes[:, 0])

    def fit(self, model):
        # a zero of the instrument is free
        zero = 1e3 * self._white(np.ones((N, 1)))
        return fit(self._white(self.observation.measured - model)[:, 0], zero)

    def up_to(self, cut_hz):
        return replace(self, cut_hz=cut_hz)

    def _white(self, signals):
        waves = np.fft.rfft(signals, axis=0)
        if self.cut_hz is not None:
            # 12 Hz are 33 waves a metre here
            waves[np.fft.rfftfreq(N, LENGTH / N) > self.cut_hz * 33.0 / 12.0] = 0.0
        return np.fft.irfft(waves, N, axis=0).astype(np.float32)


def drag(start, end, force=30.0):
    place: dict[str, object] = {'s_from_m': start, 's_to_m': end}
    return Proposal('guide_drag', place, {'force_N': force}, 0.0, fitted=('force_N',))


@pytest.fixture(scope='module')
def toy():
    frame = type('F', (), {'pitch_m': PITCH, 'rate_hz': RATE})()
    measured = 50.0 * pulls(2.13, 3.74)[:, None]
    empty = np.zeros((N, 1))
    return Toy(Observation(frame, ('a',), np.arange(N), empty, measured, empty == 0.0, 0.0))


@pytest.fixture(scope='module')
def left(toy):
    return toy.fit(np.zeros((N, 1)))


def test_the_variant_that_explains_most_is_taken_with_its_size(toy, left):
    variants = [drag(2.0, 3.5), drag(2.13, 3.74), drag(1.0, 1.5), drag(7.5, 7.9)]
    found = best_variant(toy, np.zeros((N, 1)), left, variants)
    assert found is not None
    assert found.location == {'s_from_m': 2.13, 's_to_m': 3.74}
    assert found.parameters['force_N'] == pytest.approx(50.0, rel=1e-3)


def test_nothing_that_explains_is_nothing(toy, left):
    assert best_variant(toy, np.zeros((N, 1)), left, [drag(7.5, 7.9), drag(2.0, 3.0, 0.0)]) is None


@pytest.mark.parametrize('away', [(-0.2, 0.1), (0.15, -0.25), (0.3, 0.3)])
def test_ends_are_found_from_half_a_pitch_off(toy, left, away):
    start = drag(2.13 + away[0], 3.74 + away[1], 30.0)
    found = best_stretch(toy, np.zeros((N, 1)), left, start)
    assert found.location['s_from_m'] == pytest.approx(2.13, abs=0.01)
    assert found.location['s_to_m'] == pytest.approx(3.74, abs=0.01)
    assert found.parameters['force_N'] == pytest.approx(50.0, rel=0.05)
