"""Waves of the drive's speed: a ripple is one of the rack's travel, which falls on the way down."""

from types import SimpleNamespace

import numpy as np
import pytest

from escalator_twin.diagnosis.drive import refine_wave
from escalator_twin.diagnosis.loops import Frame
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.regression import fit

pytestmark = pytest.mark.issue(6)

PITCH_M, SPEED_M_S, PITCHES = 0.405, 0.25, 100
KEYS = {'drive_ripple': 'cycles_per_pitch', 'drive_hunting': 'frequency_hz'}


class Bench:
    """A stage whose signal is the drive's speed itself, by the laws of contracts.md."""

    def __init__(self, direction: int) -> None:
        frame = Frame(PITCH_M, 60, 81, SPEED_M_S)
        travel = np.arange(PITCHES * frame.per_pitch) * frame.spacing_m
        self.direction, self.travel = direction, travel
        time = np.repeat((travel / SPEED_M_S)[:, None], 2, axis=1)
        self.observation = SimpleNamespace(travel_m=travel, frame=frame, time_s=time)
        self.setting = SimpleNamespace(experiment=SimpleNamespace(direction=direction))
        self.base = np.zeros((len(travel), 2))

    def run(self, deviations):
        (wave,) = deviations
        size, phase = (wave.parameters[k] for k in ('relative_amplitude', 'phase_rad'))
        turns = wave.parameters[KEYS[wave.cause]] * (
            self.direction * self.travel / PITCH_M
            if wave.cause == 'drive_ripple'
            else self.travel / SPEED_M_S
        )
        wave_ = size * np.sin(2.0 * np.pi * turns + phase)
        return self.base + np.stack([wave_, -0.5 * wave_], axis=1)

    def columns(self, changes, _):
        return (1e5 * changes).reshape(-1, changes.shape[2]).astype(np.float32)

    def fit(self, model):
        white = self.columns((self.measured - model)[:, :, None], '')[:, 0]
        return fit(white, np.zeros((len(white), 0), np.float32), np.zeros(0))

    def judged(self, fitted, _=None):
        return fitted.chi2


def wave(cause, frequency, phase, size=0.02):
    numbers = {'relative_amplitude': size, 'phase_rad': phase, KEYS[cause]: frequency}
    return Proposal(cause, {}, numbers, 0.0)


@pytest.mark.parametrize('direction', [1, -1], ids=['up', 'down'])
@pytest.mark.parametrize('cause', KEYS)
def test_a_frequency_is_found_whichever_way_the_machine_runs(cause, direction):
    bench = Bench(direction)
    bench.measured = bench.run((wave(cause, 0.37, 0.4).deviation,))
    near = wave(cause, 0.37 + 0.15 / PITCHES, 1.4, 0.011)
    before = bench.fit(bench.base)
    found = refine_wave(bench, bench.base, before, near, cause == 'drive_hunting').proposal
    numbers = found.parameters
    assert numbers[KEYS[cause]] == pytest.approx(0.37, abs=2e-5)
    assert numbers['relative_amplitude'] == pytest.approx(0.02, rel=0.01)
    # at the recording's beginning, to which phases are told
    assert numbers['phase_rad'] == pytest.approx(0.4, abs=0.02)
