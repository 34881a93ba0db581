"""Waves of the drive's speed: a ripple is one of the rack's travel, which falls on the way down."""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pytest

from escalator_twin.diagnosis import fitting, waves
from escalator_twin.diagnosis.drive import agreed, locks, refine_wave, Told, told_apart
from escalator_twin.diagnosis.grids import Frame
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.regression import fit
from escalator_twin.diagnosis.stage import lateness_of, LATENESS_STEP_S
from escalator_twin.diagnosis.tried import Tried
from escalator_twin.diagnosis.waves import as_locked, best_wave_alone

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
            else self.observation.time_s[:, 0]
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


@pytest.mark.parametrize('cause', KEYS)
def test_where_the_speed_wanders_time_is_told_from_travel(cause):
    bench = Bench(1)
    late = 0.3 * np.sin(2.0 * np.pi * bench.travel / bench.travel[-1] * 1.7)
    bench.observation.time_s = bench.observation.time_s + late[:, None]
    own = bench.observation.time_s[:, 0] if cause == 'drive_hunting' else bench.travel / SPEED_M_S
    signal = 0.02 * np.sin(2.0 * np.pi * 0.37 * own + 0.4)
    bench.measured = np.stack([signal, -0.5 * signal], axis=1)
    better = locks(bench, bench.base, wave('drive_hunting', 0.37, 1.4, 0.011)).better
    assert (better if cause == 'drive_hunting' else -better) > 1e3
    # without a wander there is nothing to tell
    bench.observation.time_s = np.repeat((bench.travel / SPEED_M_S)[:, None], 2, axis=1)
    assert abs(locks(bench, bench.base, wave('drive_hunting', 0.37, 1.4, 0.011)).better) < 1e-6


@pytest.mark.issue(7)
@pytest.mark.parametrize('direction', [1, -1], ids=['up', 'down'])
@pytest.mark.parametrize('cause', KEYS)
def test_at_an_even_speed_a_wave_is_the_same_in_the_other_lock(cause, direction):
    bench = Bench(direction)
    own = wave(cause, 0.37, 0.4)
    (name,) = set(KEYS) - {cause}
    other = as_locked(own, name, bench.observation.frame, direction)
    assert other.cause == name
    np.testing.assert_allclose(
        bench.run((other.deviation,)), bench.run((own.deviation,)), atol=1e-12
    )
    back = as_locked(other, cause, bench.observation.frame, direction)
    assert back.parameters == pytest.approx(own.parameters)


@pytest.mark.issue(7)
def test_of_all_waves_the_best_alone_is_fitted_with_all_else():
    rows = [
        SimpleNamespace(proposal=p)
        for p in (
            wave('drive_hunting', 0.37, 0.4),
            wave('drive_ripple', 0.6, 0.4),
            Proposal('tensioner_friction', {}, {'force_N': 80.0}, 0.0),
        )
    ]
    assert best_wave_alone(rows) == [rows[0], rows[2]]


@pytest.mark.issue(7)
def test_the_lateness_is_by_how_much_later_the_recording_came_there():
    speed, span = 0.4, 60.0
    travel = SimpleNamespace(at=lambda t: speed * (t - 0.05 * np.sin(0.2 * t)))
    setting = SimpleNamespace(
        experiment=SimpleNamespace(set_speed_m_s=speed), duration_s=span, travel=travel
    )
    lateness = lateness_of(setting)
    even = np.arange(len(lateness)) * LATENESS_STEP_S
    assert even[-1] >= span
    assert lateness.mean() == pytest.approx(0.0, abs=1e-12)
    # but for one number, the phase of waves, the recording's clock where the even run is at a time
    ahead = np.array([travel.at(t + late) for t, late in zip(even, lateness, strict=True)])
    shift = (ahead - speed * even) / speed
    assert np.ptp(shift) < 1e-3
    assert np.ptp(lateness) > 0.09


@pytest.mark.parametrize('off', [-50.0, -500.0])
def test_two_models_are_told_apart_by_no_more_than_they_differ(off):
    # a fit along (1, 0) or along a line a hundredth of a radian beside it, of a point off both
    angle, point = 0.01, np.array([100.0, off])
    lines = np.array([[1.0, 0.0], [np.cos(angle), np.sin(angle)]])
    right, gram = lines @ point, lines @ lines.T
    differ = (lines[0] @ point * np.sin(angle)) ** 2
    most = differ + 2.0 * np.sqrt(differ)  # and one standard deviation of noise
    told, turned = told_apart(right, gram), told_apart(right[::-1], gram[::-1, ::-1])
    assert (told.better, turned.better) == pytest.approx((most, -most), rel=1e-3)
    assert told.apart == pytest.approx(differ, rel=1e-3)


def test_two_models_are_told_apart_by_what_the_one_explains_more():
    angle, point = 0.01, np.array([100.0, 0.0])
    lines = np.array([[1.0, 0.0], [np.cos(angle), np.sin(angle)]])
    more = (100.0 * np.sin(angle)) ** 2
    assert told_apart(lines @ point, lines @ lines.T).better == pytest.approx(more, rel=1e-3)


@pytest.mark.parametrize('bent', [0.0, 0.15, 0.5])
@pytest.mark.parametrize('apart', [0.3, 1.0, 3.0, 12.0])
def test_which_lock_it_is_is_told_as_surely_as_it_comes_right(apart, bent):
    """Either of two nearly like models is the true one; noise, and alignments that bend it by half of what tells them.

    In five recordings they did by 0.02 to 0.5 of that (seeds 231101 and 251101).
    """
    rng = np.random.default_rng(7)
    angle = np.sqrt(apart) / 100.0
    lines = np.array([[1.0, 0.0], [np.cos(angle), np.sin(angle)]])
    belief, right = [], []
    for true in rng.integers(0, 2, 4000):
        point = 100.0 * lines[true] + rng.normal(size=2)
        told = told_apart(lines @ point, lines @ lines.T)
        off = bent * told.apart * rng.normal(size=2)
        better = agreed(*(Told(told.better + one, told.apart) for one in off))
        belief.append(1.0 / (1.0 + np.exp(-0.5 * abs(better))))
        right.append((better < 0.0) == bool(true))
    # what is beyond noise counts for nothing: a little too modest, hardly too sure
    assert -0.02 < np.mean(right) - np.mean(belief) < 0.06


def test_two_alignments_that_say_the_opposite_say_nothing():
    assert agreed(Told(9.0, 12.0), Told(-9.0, 12.0)) == 0.0
    assert agreed(Told(0.0, 0.0), Told(0.0, 0.0)) == 0.0
    alike = agreed(Told(9.0, 12.0), Told(9.0, 12.0))
    assert alike == 9.0
    assert 0.0 < agreed(Told(15.0, 12.0), Told(3.0, 12.0)) < alike


@dataclass(frozen=True)
class Aligned:
    """A stage of a recording that was aligned beside something."""

    machine: object
    beside: str = ''

    def run(self):
        return None


def test_a_wave_is_weighed_in_both_alignments(monkeypatch):
    """Each bends the recording towards its own lock."""
    told = {'drive_hunting': Told(10.0, 12.0), 'drive_ripple': Told(-4.0, 12.0)}
    machine = SimpleNamespace(deviations=())
    bench = Bench(1)

    def beside(_context, deviations, **_):
        return SimpleNamespace(stage=Aligned(None, deviations[-1].cause))

    def locks_of(stage, _base, hunting, _jobs):
        assert hunting.cause == 'drive_hunting'
        return told[stage.beside]

    monkeypatch.setattr(waves, 'beside', beside)
    monkeypatch.setattr(waves, 'locks', locks_of)
    stage = SimpleNamespace(observation=bench.observation, turned={}, machine=machine)
    context = SimpleNamespace(machine=machine, setting=bench.setting)
    rows = [
        Tried(wave('drive_hunting', 0.37, 0.4), 500.0, {}),
        Tried(wave('drive_ripple', 0.37 * PITCH_M / SPEED_M_S, 0.4), 480.0, {}),
    ]
    hunting, ripple = waves.locked(context, SimpleNamespace(stage=stage), rows)
    assert hunting.gain == 500.0
    assert ripple.gain == pytest.approx(500.0 - agreed(*told.values()))
    assert 0.0 < 500.0 - ripple.gain < 3.0
    # what is no effect has no lock
    monkeypatch.setattr(waves, 'beside', lambda *_, **__: pytest.fail('aligned anew'))
    noise = [replace(t, gain=15.0) for t in rows]
    assert waves.locked(context, SimpleNamespace(stage=stage), noise) == noise


def test_beside_a_fault_of_the_measurement_alone_no_tolerance_is_tuned_again(monkeypatch):
    gauge = Proposal('gauge_gain', {'link': 'left_b'}, {'factor': 1.09}, 400.0)
    turned = {'tensioner.stiffness_n_m': 1.9}
    place = SimpleNamespace(stage=SimpleNamespace(turned=turned))
    monkeypatch.setattr(fitting, 'beside', lambda _, steps, turned: (steps, turned))
    monkeypatch.setattr(fitting, 'tuned', lambda *_: pytest.fail('tuned again'))
    found = fitting.fit_again('context', place, [gauge])
    assert (found.context, found.place) == ('context', (0, turned))
    assert found.effects == found.sd == ()
