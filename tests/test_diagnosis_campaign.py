"""What several recordings of one machine say together."""

import pytest

from escalator_twin.diagnosis.campaign import pooled, same

pytestmark = pytest.mark.issue(7)


def drag(force=120.0, half=10.0, probability=0.9, axle=44, alternatives=()):
    return {
        'cause': 'roller_drag',
        'location': {'axle': axle, 'side': 'left'},
        'parameters': {'force_N': {'value': force, 'low': force - half, 'high': force + half}},
        'probability': probability,
        'alternatives': list(alternatives),
    }


def step(s_m, **more):
    return {**drag(**more), 'cause': 'guide_step', 'location': {'s_m': s_m, 'side': 'left'}}


def test_a_single_recording_is_what_it_says():
    (effect,) = pooled([[drag()]])
    force = effect['parameters']['force_N']
    assert (force['value'], force['low'], force['high']) == pytest.approx((120.0, 110.0, 130.0))
    assert effect['probability'] == pytest.approx(0.9)
    assert (effect['recordings'], effect['of']) == (1, 1)


def test_sizes_are_weighed_by_their_intervals():
    # weights 1 / 10^2 and 1 / 20^2: (4 * 118 + 124) / 5, half width 20 / sqrt(5)
    (effect,) = pooled([[drag(118.0, 10.0)], [drag(124.0, 20.0)]])
    force = effect['parameters']['force_N']
    assert force['value'] == pytest.approx(119.2)
    assert force['high'] - force['value'] == pytest.approx(20.0 / 5**0.5, rel=1e-6)
    assert effect['recordings'] == 2


def test_sizes_that_scatter_more_than_they_say_widen_the_interval():
    (effect,) = pooled([[drag(100.0, 1.0)], [drag(140.0, 1.0)]])
    force = effect['parameters']['force_N']
    assert force['low'] < 100.0 < 140.0 < force['high']


def test_recordings_that_agree_are_surer_together():
    (effect,) = pooled([[drag(probability=0.8)], [drag(probability=0.7)]])
    assert effect['probability'] == pytest.approx(1.0 - 0.2 * 0.3)


def test_what_one_of_many_alone_says_is_not_taken():
    assert pooled([[drag()], *[[]] * 15]) == []
    many = pooled([[drag()]] * 6 + [[]] * 10)
    assert [effect['recordings'] for effect in many] == [6]


def test_places_stay_apart():
    effects = pooled([[drag(axle=44), drag(axle=45, probability=0.6)]])
    assert [e['location']['axle'] for e in effects] == [44, 45]


def test_nearby_places_of_the_guide_are_one():
    assert same(step(3.0), step(3.2))
    assert not same(step(3.0), step(3.5))
    assert not same(step(3.0), drag())
    one = {'cause': 'load_distribution', 'location': {'steps': [2, 3, 4]}}
    other = {'cause': 'load_distribution', 'location': {'steps': [3, 4, 5]}}
    away = {'cause': 'load_distribution', 'location': {'steps': [12, 13, 14]}}
    assert same(one, other)
    assert not same(one, away)


def test_only_alternatives_that_all_leave_open_stay():
    both = drag(alternatives=['step_mass'])
    assert pooled([[both], [both]])[0]['alternatives'] == ['step_mass']
    assert pooled([[both], [drag(probability=0.5)]])[0]['alternatives'] == []


def test_nothing_named_is_nothing_together():
    assert pooled([[], [], []]) == []
