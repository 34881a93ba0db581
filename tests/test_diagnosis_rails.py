"""What the survey leaves open of the rail, and what it does to the signals."""

from dataclasses import replace

import numpy as np
import pytest
import trials

from escalator_twin.diagnosis.grids import Frame
from escalator_twin.diagnosis.loops import alike, sensor_probes, simulate_rails
from escalator_twin.diagnosis.rails import draw_rails, rail_columns
from escalator_twin.machine import Deviation
from escalator_twin.physics.survey import spectrum_of

pytestmark = pytest.mark.issue(6)


def test_the_spectrum_of_a_drawn_rail_is_found_again():
    rng = np.random.default_rng(3)
    n, level, slope, error = 488, -9.5, 2.0, 5e-5
    number = np.arange(1, n // 2 + 1)
    waves = np.zeros(n // 2 + 1, complex)
    power = np.exp(level - slope * np.log(number))
    waves[1:] = np.sqrt(power * n / 2.0) * (rng.normal(size=(2, len(number))).T @ [1.0, 1j])
    values = np.fft.irfft(waves, n) + rng.normal(0.0, error, n)
    found_level, found_slope = spectrum_of(values, error)
    assert found_slope == pytest.approx(slope, abs=0.3)
    assert found_level == pytest.approx(level, abs=1.0)


def test_what_is_open_is_the_surveys_error_and_no_more():
    """White error of 0.05 mm a point leaves each surveyed wave open by at most that."""
    machine = trials.prototype()
    rails = np.array([rail[:, 0] for rail in draw_rails(machine, 60)])
    assert 0.2 * machine.guide.survey_error_m < rails.std() < 1.5 * machine.guide.survey_error_m
    # its slope is that of the deviation
    one = draw_rails(machine, 1)[0]
    step = 24.4057 / len(one)
    slope = (np.roll(one[:, 0], -1) - np.roll(one[:, 0], 1)) / (2.0 * step)
    assert np.corrcoef(slope, one[:, 1])[0, 1] > 0.98


def test_an_exact_survey_leaves_short_waves_alone():
    machine = trials.prototype()
    exact = replace(machine, guide=replace(machine.guide, survey_error_m=1e-9))
    waves = np.abs(np.fft.rfft(draw_rails(exact, 1)[0][:, 0]))
    assert waves[1:200].max() < 1e-3 * waves[244:].max()


def test_without_a_survey_there_is_nothing_to_draw():
    machine = trials.smooth_prototype()
    assert draw_rails(machine) == []
    assert rail_columns(machine, trials.case(), Frame.of(machine, 0.5)).shape[2] == 0


def test_parts_unlike_the_others_are_left_out_where_one_pitch_stands_for_all():
    friction = Deviation('tensioner_friction', {'force_N': 150.0})
    link = Deviation('link_elongation', {'length_m': 3e-3}, {'link': 4})
    drag = Deviation('roller_drag', {'force_N': 120.0}, {'axle': 3, 'side': 'left'})
    machine = replace(trials.prototype(), deviations=(friction, link, drag))
    loads = tuple(150.0 * (k % 2) for k in range(60))
    kept, equal = alike(machine, replace(trials.case(), load_per_step_kg=loads))
    assert kept.deviations == (friction,)
    assert equal.load_per_step_kg == (75.0,)
    # a step's load takes no pitch for another's
    few = draw_rails(machine, 2)
    frame = Frame.of(machine, 0.5)
    seen = sensor_probes(machine.instruments.sensors, frame.n_links)
    with pytest.raises(AssertionError, match='one pitch'):
        simulate_rails(machine, trials.case(), frame, seen, few)
    assert len(simulate_rails(kept, equal, frame, seen, few)) == 2


def test_columns_hold_the_spread_of_the_signals():
    """The sum of the columns' squares is the variance over rails that were not drawn for them."""
    machine, experiment = trials.prototype(), trials.case()
    frame = Frame.of(machine, experiment.set_speed_m_s)
    columns = rail_columns(machine, experiment, frame)
    seen = sensor_probes(machine.instruments.sensors, frame.n_links)
    others = draw_rails(machine, 16, seed=99)
    changes = np.stack(simulate_rails(machine, experiment, frame, seen, others))
    for k in range(5):  # forces and tensioner
        told = np.sum(columns[:, k] ** 2, axis=1).mean() ** 0.5
        assert told == pytest.approx(changes[:, :, k].std(), rel=0.35)
    # and their directions: most of a new rail's change lies in the columns
    white = columns[:, :4].reshape(-1, columns.shape[2])
    for change in changes[:4, :, :4].reshape(4, -1):
        sizes = np.linalg.lstsq(white, change, rcond=None)[0]
        assert np.std(change - white @ sizes) < 0.3 * np.std(change)


def test_columns_do_not_hang_on_how_many_ran_at_a_time():
    machine, experiment = trials.prototype(), trials.case()
    frame = Frame.of(machine, 0.5)
    one, three = (rail_columns(machine, experiment, frame, jobs) for jobs in (1, 3))
    np.testing.assert_array_equal(one, three)


def test_a_rail_is_left_out_of_no_steady_machine():
    """Laid under the running machine, it shakes the carriage, which must have swung out."""
    machine, experiment = alike(
        trials.prototype(), trials.case(speed=0.48, load=0.0, preload=6000.0)
    )
    frame = Frame.of(machine, experiment.set_speed_m_s)
    seen = sensor_probes(machine.instruments.sensors, frame.n_links)
    rails = draw_rails(machine, 12)
    changes = simulate_rails(machine, experiment, frame, seen, rails, 2)
    assert len(changes) == len(rails)
    # a tenth of a rail does a tenth of it
    tenth = simulate_rails(machine, experiment, frame, seen, [0.1 * rails[0]])[0]
    forces = slice(0, 4)
    apart = 10.0 * tenth[:, forces] - changes[0][:, forces]
    assert np.std(apart) < 0.1 * np.std(changes[0][:, forces])


def test_a_rail_does_no_sum_of_what_its_parts_do():
    """No column that was taken over one rail is exact beside another."""
    machine, experiment = alike(trials.prototype(), trials.case())
    frame = Frame.of(machine, experiment.set_speed_m_s)
    seen = sensor_probes(machine.instruments.sensors, frame.n_links)
    rails = [share * rail for rail in draw_rails(machine, 3) for share in (1.0, 0.5, -1.0)]
    found = np.stack(simulate_rails(machine, experiment, frame, seen, rails, 2))
    whole, half, turned = (found[k::3] for k in range(3))

    def off(change, share, channel):
        return np.std((change - share * whole)[..., channel], 1) / np.std(whole[..., channel], 1)

    forces, x = 0, 5
    assert np.all((off(half, 0.5, forces) > 0.01) & (off(half, 0.5, forces) < 0.04))
    assert np.all((off(half, 0.5, x) > 0.02) & (off(half, 0.5, x) < 0.06))
    assert np.all((off(turned, -1.0, forces) > 0.04) & (off(turned, -1.0, forces) < 0.08))
    assert np.all((off(turned, -1.0, x) > 0.07) & (off(turned, -1.0, x) < 0.16))
