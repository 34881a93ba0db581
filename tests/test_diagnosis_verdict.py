"""Weighing: beliefs add up, tolerances are no effects, and more explained is more believed."""

from dataclasses import replace

import numpy as np
import pytest

from escalator_twin.causes import CAUSES
from escalator_twin.causes.registry import KNOWN
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.verdict import (
    FAR_SIZE,
    size_in_nearest,
    size_in_references,
    size_in_tolerances,
    SLIGHT_SIZE,
    weigh,
)

pytestmark = pytest.mark.issue(6)


def proposal(cause, parameters, gain=100.0, places=1, **location):
    return Proposal(cause, dict(location), dict(parameters), gain, {}, places, tuple(parameters))


def drag(axle, gain, force=120.0):
    return proposal('roller_drag', {'force_N': force}, gain, 120, axle=axle, side='left'), gain


def friction(force, gain):
    return proposal('tensioner_friction', {'force_N': force}, gain), gain


@pytest.mark.parametrize('seed', range(20))
def test_beliefs_and_none_add_up(seed):
    rng = np.random.default_rng(seed)
    candidates = [drag(int(k), float(rng.exponential(60.0))) for k in range(rng.integers(1, 9))]
    candidates.append(friction(150.0, float(rng.exponential(60.0))))
    probabilities = [w.probability for w in weigh(candidates)]
    assert len(probabilities) == len(candidates)
    assert all(0.0 <= p <= 1.0 for p in probabilities)
    assert sum(probabilities) <= 1.0 + 1e-12


def test_nothing_to_weigh():
    assert weigh([]) == []


def test_nothing_explained_is_not_believed():
    (weighed,) = weigh([drag(7, 0.0)])
    assert weighed.probability == 0.0


def test_noise_is_not_believed():
    # the best of 120 places of white noise reaches about 2 ln 120 = 10 in chi squared
    assert sum(w.probability for w in weigh([drag(k, 10.0 - k) for k in range(4)])) < 0.05


def test_much_explained_is_believed():
    first = weigh([drag(7, 500.0), drag(8, 300.0)])[0]
    assert first.proposal.location['axle'] == 7
    assert first.probability > 0.99


# contracts.md: an effect is more than three tolerances
@pytest.mark.parametrize(
    ('cause', 'neutral', 'parameter', 'tolerance'),
    [
        ('tensioner_friction', 0.0, 'force_N', 10.0),
        ('tensioner_stiffness', 1.0, 'factor', 0.02),
        ('tensioner_preload', 1.0, 'factor', 0.02),
        ('link_elongation', 0.0, 'length_m', 5e-5),
        ('chain_elongation', 0.0, 'length_m', 5e-6),
        ('roller_drag', 0.0, 'force_N', 5.0),
        ('roller_eccentricity', 0.0, 'amplitude_m', 2e-5),
        ('roller_flat', 0.0, 'depth_m', 2e-5),
        ('rolling_resistance', 1.0, 'factor', 0.10),
        ('guide_step', 0.0, 'height_m', 1e-4),
        ('landing_length', 0.0, 'delta_m', 1e-3),
        ('guide_drag', 0.0, 'force_N', 3.0),
        ('drive_ripple', 0.0, 'relative_amplitude', 0.001),
        ('drive_hunting', 0.0, 'relative_amplitude', 0.001),
        ('load_distribution', 1.0, 'load_factor', 0.01),
        ('load_offset', 0.5, 'left_share', 0.005),
        ('step_mass', 0.0, 'delta_kg', 0.3),
        ('gauge_gain', 1.0, 'factor', 0.003),
        ('gauge_drift', 0.0, 'strain', 1e-6),
        ('clock_drift', 0.0, 'ppm', 20.0),
    ],
)
def test_what_a_machine_within_tolerance_has_is_never_named(cause, neutral, parameter, tolerance):
    inside = proposal(cause, {parameter: neutral + 2.9 * tolerance})
    beyond = proposal(cause, {parameter: neutral + 9.0 * tolerance})
    assert size_in_tolerances(inside) == pytest.approx(2.9)
    assert weigh([(inside, 1e6)])[0].probability == 0.0
    assert weigh([(beyond, 1e6)])[0].probability > 0.9


def test_a_cause_without_a_tolerance_is_any_size_away():
    stop = proposal('tensioner_stop', {'displacement_m': 2e-3})
    assert size_in_tolerances(stop) == np.inf


def test_more_explained_is_more_believed():
    gains = [400.0, 380.0, 410.0, 395.0, 300.0]
    weighed = weigh([drag(k, gain) for k, gain in enumerate(gains)])
    assert [w.gain for w in weighed] == sorted(gains, reverse=True)
    probabilities = [w.probability for w in weighed]
    assert probabilities == sorted(probabilities, reverse=True)


def test_of_two_that_explain_alike_none_is_sure():
    weighed = weigh([drag(7, 400.0), drag(8, 400.0)])
    assert [w.probability for w in weighed] == pytest.approx([0.5, 0.5], abs=1e-6)


def test_of_two_that_explain_alike_the_larger_is_no_likelier():
    """Both are effects beyond doubt: which of them it is, is not told by how many tolerances they are."""
    weighed = weigh([drag(7, 4000.0, 60.0), drag(8, 4000.0, 48.0)])
    assert [w.probability for w in weighed] == pytest.approx([0.5, 0.5], abs=1e-6)


def test_a_rival_that_a_good_machine_may_have_is_hardly_believed():
    weighed = weigh([drag(7, 4000.0, 120.0), drag(8, 4000.0, 16.0)])
    assert weighed[0].proposal.location['axle'] == 7
    assert weighed[1].probability < 0.05


def test_a_tolerance_does_not_hide_an_effect():
    weighed = weigh([friction(20.0, 900.0), drag(7, 500.0)])
    assert weighed[0].proposal.cause == 'roller_drag'
    assert weighed[0].probability > 0.9


def test_more_places_to_choose_from_cost_belief():
    few = proposal('roller_drag', {'force_N': 120.0}, places=2)
    many = proposal('roller_drag', {'force_N': 120.0}, places=10_000)
    assert weigh([(few, 30.0)])[0].probability > weigh([(many, 30.0)])[0].probability


def test_every_cause_can_be_weighed():
    for cause in CAUSES.values():
        parameters = dict(cause.references[0]) if cause.references else {}
        (weighed,) = weigh([(proposal(cause.name, parameters), 1e4)])
        assert 0.0 <= weighed.probability <= 1.0


@pytest.mark.parametrize(
    ('cause', 'parameters', 'times'),
    [
        ('tensioner_stiffness', {'factor': 0.4}, 2.57),  # log 2.5 over log 1 / 0.7
        ('tensioner_stiffness', {'factor': 1.8}, 2.0),  # 0.8 over 0.4
        ('tensioner_stiffness', {'factor': 2.29}, 3.225),
        ('landing_length', {'delta_m': -1.2e-2}, 2.0),
        ('load_distribution', {'load_factor': 0.0}, 1.0),
        (
            'truss_resonance',
            {'modal_mass_kg': 9e3, 'frequency_hz': 4.0, 'damping_ratio': 0.04},
            0.0,
        ),
    ],
)
def test_a_size_is_told_in_references(cause, parameters, times):
    found = size_in_references(Proposal(cause, {}, parameters, 0.0))
    assert found == pytest.approx(times, rel=0.01)


@pytest.mark.parametrize(
    ('cause', 'parameters', 'times'),
    [
        ('chain_elongation', {'length_m': 3.23e-5}, 0.215),  # of 0.15 mm
        ('rolling_resistance', {'factor': 0.8}, 0.5),  # 0.2 of the 0.4 that 0.6 is away
        ('rolling_resistance', {'factor': 1.3}, 0.5),  # of the 0.6 of 1.6
        ('guide_step', {'height_m': -5e-4}, 1 / 3),  # the only reference is a rise
        ('load_distribution', {'load_factor': 0.9}, 0.1),
        ('tensioner_stop', {'displacement_m': 5e-3}, np.inf),  # without a size that may be none
    ],
)
def test_a_size_is_told_in_the_reference_to_its_side(cause, parameters, times):
    found = size_in_nearest(Proposal(cause, {}, parameters, 0.0))
    assert found == pytest.approx(times, rel=0.01)


def test_every_reference_is_within_what_a_cause_is_known_with():
    for cause in KNOWN.values():
        for reference in cause.references:
            whole = Proposal(cause.name, {}, dict(reference), 0.0)
            assert size_in_references(whole) <= 1.0
            assert size_in_nearest(whole) >= 1.0
    assert FAR_SIZE > 2.0  # twice of it is drawn by the generator
    assert SLIGHT_SIZE < 1 / 3  # the least for which there is a bar


def stretch(tolerances, gain, places=4851, draws=98):
    found = proposal(
        'guide_drag', {'force_N': 3.0 * tolerances}, gain, places, s_from_m=9.3, s_to_m=10.6
    )
    return replace(found, fitted=('force_N', '@s_from_m', '@s_to_m'), draws=draws), gain


def test_where_an_effect_is_costs_what_the_data_tell_and_not_what_a_tolerance_is():
    """A third of the reference, 5.5 tolerances, where ten thousand of chi squared say it is."""
    assert weigh([stretch(5.5, 1e4)])[0].probability > 0.95
    assert weigh([stretch(5.5, 1e4, draws=None)])[0].probability < 0.05  # each place may have one
    assert weigh([stretch(50.0, 30.0)])[0].probability < 0.05  # the data say too little
    assert weigh([stretch(3.1, 1e4)])[0].probability < 0.05


@pytest.mark.parametrize('draws', [1, 10, 49, 98])
def test_the_largest_that_a_good_machine_has_is_seldom_named(draws):
    rng = np.random.default_rng(draws)
    largest = np.abs(rng.normal(size=(4000, draws))).max(axis=1)
    named = [weigh([stretch(z, 300.0 * z**2, draws=draws)])[0].probability > 0.5 for z in largest]
    assert np.mean(named) < 0.01  # contracts.md: at most 2 %


@pytest.mark.parametrize(
    ('tolerances', 'gain', 'is_named'), [(5.2, 112.0, True), (3.5, 1e4, False), (5.2, 45.0, False)]
)
def test_a_good_machine_has_a_step_at_each_end_of_its_rails(tolerances, gain, is_named):
    step = proposal('guide_step', {'height_m': 1e-4 * tolerances}, gain, 294, s_m=20.0)
    step = replace(step, fitted=('height_m', '@s_m', 'length_m'), draws=49)
    assert (weigh([(step, gain)])[0].probability > 0.5) == is_named


@pytest.mark.parametrize('seed', range(5))
def test_noise_at_the_best_of_many_places_is_not_believed(seed):
    gain = float(np.random.default_rng(seed).chisquare(3, 4851).max())
    assert weigh([stretch(9.0, gain)])[0].probability < 0.05


@pytest.mark.parametrize(('tolerances', 'named'), [(3.1, False), (4.0, True), (4.5, True)])
def test_a_gauges_gain_is_likelier_than_not_at_four_tolerances(tolerances, named):
    gauge = proposal('gauge_gain', {'factor': 1.0 + 0.003 * tolerances}, link='left_a')
    gauge = replace(gauge, nuisance='link_force/left_a/gain')
    # what lifting the prior gains where the data leave no doubt of the size: its square
    (weighed,) = weigh([(gauge, tolerances**2)])
    assert (weighed.probability > 0.5) is named


def turned(x, y, z):
    """Return an accelerometer turned by so many tolerances, and what lifting the prior gains."""
    degrees = {'x_deg': 0.3 * x, 'y_deg': 0.3 * y, 'z_deg': 0.3 * z}
    found = proposal('accelerometer_misalignment', degrees)
    return replace(found, nuisance='rotation'), x * x + y * y + z * z


def test_an_accelerometer_turned_by_a_third_of_the_reference_is_named():
    for way in np.random.default_rng(4).normal(size=(20, 3)):
        x, y, z = 4.0 / 3.0 / 0.3 * way / np.linalg.norm(way)  # contracts.md: 4 degrees in all
        assert weigh([turned(x, y, z)])[0].probability > 0.5


def test_a_good_accelerometer_is_seldom_called_turned():
    draws = np.random.default_rng(8).normal(size=(8000, 3))
    named = [weigh([turned(x, y, z)])[0].probability > 0.5 for x, y, z in draws]
    assert np.mean(named) < 0.002  # contracts.md: at most 2 %, of all causes together


def test_a_right_angle_is_no_matter_of_tolerances():
    assert weigh([turned(300.0, 0.0, 0.0)])[0].probability > 0.999
