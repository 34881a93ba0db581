"""What several recordings of one machine say together."""

from dataclasses import replace
from itertools import product
from types import SimpleNamespace

import pytest

from escalator_twin.diagnosis.campaign import decide, pooled, union_of
from escalator_twin.diagnosis.faults import Fault
from escalator_twin.diagnosis.found import Found
from escalator_twin.diagnosis.jointly import joint_gain, told_jointly
from escalator_twin.diagnosis.proposals import Proposal, same_place
from escalator_twin.diagnosis.scores import HeldOut
from escalator_twin.diagnosis.scouts import choose_scouts, shared_by
from escalator_twin.diagnosis.verdict import Weighed
from escalator_twin.signals import Experiment

pytestmark = pytest.mark.issue(7)


def drag(force=120.0, axle=44):
    place: dict[str, object] = {'axle': axle, 'side': 'left'}
    return Proposal('roller_drag', place, {'force_N': force}, 1e3, fitted=('force_N',))


def step(s_m):
    place: dict[str, object] = {'s_m': s_m, 'side': 'left'}
    return Proposal(
        'guide_step', place, {'height_m': 1e-3, 'length_m': 0.06}, 1e3, fitted=('height_m', '@s_m')
    )


def found(proposal, sd=5.0, probability=0.9):
    return Found(proposal, probability, {proposal.fitted[0]: sd}, 500.0, ())


def scout(*pairs):
    return SimpleNamespace(found=pairs)


def other(*rows):
    """Return another recording: of each effect its own proposal and standard deviation."""
    return SimpleNamespace(
        effects=tuple(p for p, _ in rows),
        sd=tuple({p.fitted[0]: sd} for p, sd in rows),
    )


def test_sizes_are_weighed_by_what_they_are_known_to():
    # a law's 2 % of 124 N beside 1 N and 4 N
    one, two = (2.48**2 + 1.0) ** -1.0, (2.48**2 + 16.0) ** -1.0
    joined = pooled([(drag(118.0), {'force_N': 1.0}), (drag(124.0), {'force_N': 4.0})])
    expected = (118.0 * one + 124.0 * two) / (one + two)
    assert joined.proposal.parameters['force_N'] == pytest.approx(expected)
    assert joined.sd['force_N'] >= (one + two) ** -0.5


def test_sizes_that_scatter_more_than_they_say_widen_the_interval():
    joined = pooled([(drag(100.0), {'force_N': 0.1}), (drag(140.0), {'force_N': 0.1})])
    assert joined.proposal.parameters['force_N'] == pytest.approx(120.0, rel=0.01)
    assert joined.sd['force_N'] > 15.0


def test_where_a_machines_carriage_rests_is_no_better_known_by_many():
    stop = Proposal(
        'tensioner_stop', {}, {'displacement_m': 5e-3}, 1e3, fitted=('displacement_m',)
    )
    rows = [(stop, {'displacement_m': 1.4e-3})] * 16
    assert pooled(rows).sd['displacement_m'] == pytest.approx(1.4e-3)


def test_places_along_the_guide_are_pooled_and_phases_are_not():
    rows = [(step(3.0), {'height_m': 1e-5, '@s_m': 0.01}), (step(3.1), {'@s_m': 0.01})]
    assert pooled(rows).proposal.location['s_m'] == pytest.approx(3.05)
    turning = replace(drag(), parameters={'force_N': 120.0, 'phase_rad': 1.0})
    away = replace(turning, parameters={'force_N': 120.0, 'phase_rad': -1.0})
    rows = [(p, {'force_N': 1.0, 'phase_rad': 0.1}) for p in (turning, away)]
    assert pooled(rows).proposal.parameters['phase_rad'] == 1.0


def test_nearby_places_of_the_guide_are_one_and_others_are_not():
    assert same_place(step(3.0), step(3.2))
    assert not same_place(step(3.0), step(3.5))
    assert not same_place(step(3.0), drag())
    assert not same_place(drag(axle=44), drag(axle=45))
    loads = [
        Proposal('load_distribution', {'steps': steps}, {'load_factor': 0.0}, 1.0)
        for steps in ([2, 3, 4], [3, 4, 5], [12, 13, 14])
    ]
    assert same_place(loads[0], loads[1])
    assert not same_place(loads[0], loads[2])


def test_union_holds_every_named_effect_once_and_leaves_doubts_out():
    groups = union_of([
        scout((found(drag(118.0)), 0.8), (found(step(3.0)), 0.4)),
        scout((found(drag(122.0)), 0.95)),
        scout((found(drag(axle=9)), 0.7)),
    ])  # fmt: skip
    assert [[f.proposal.location['axle'] for f, _ in g] for g in groups] == [[44, 44], [9]]
    assert groups[0][0][1] == 0.95


def seen(side, beliefs, height=1e-3):
    """Return a rail's step as found on one side, by one who believes so much in each."""
    at = {name: replace(step(3.0), location={'s_m': 3.0, 'side': name}) for name in beliefs}
    rivals = tuple(Weighed(at[name], 9.0, 9.0, belief) for name, belief in beliefs.items())
    own = replace(at[side], parameters={'height_m': height, 'length_m': 0.06})
    return Found(own, beliefs[side], {'height_m': 1e-5}, 500.0, rivals)


@pytest.mark.parametrize(
    ('scouts', 'side'),
    [
        # two doubt it, one is sure: 0.7 * 0.7 * 0.01 for both, 0.2 * 0.2 * 0.9 for the right
        ([('both', 0.7, 0.2), ('both', 0.7, 0.2), ('right', 0.0, 0.9)], 'right'),
        ([('both', 0.9, 0.05), ('both', 0.9, 0.05), ('right', 0.3, 0.6)], 'both'),
        ([('both', 0.6, 0.35), ('right', 0.1, 0.9)], 'right'),
    ],
)
def test_of_one_step_on_different_sides_is_named_what_all_believe_in_most(scouts, side):
    drags = (found(drag()), 0.9)
    rows = [
        scout(drags, (seen(own, {'both': both, 'right': right}), 0.8))
        for own, both, right in scouts
    ]
    groups = union_of(rows)
    assert [g[0][0].proposal.cause for g in groups] == ['roller_drag', 'guide_step']
    assert {f.proposal.location['side'] for f, _ in groups[1]} == {side}
    assert len(groups[1]) == sum(own == side for own, _, _ in scouts)


def test_a_side_that_a_scout_did_not_weigh_is_not_ruled_out():
    rows = [
        scout((seen('right', {'right': 0.9}), 0.9)),
        scout((seen('both', {'both': 0.95}), 0.95)),
    ]
    ((one, _),) = union_of(rows)[0]
    assert one.proposal.location['side'] == 'both'


def test_sides_that_one_scout_names_together_are_two_effects():
    left, right = drag(), replace(drag(), location={'axle': 44, 'side': 'right'})
    both = scout((found(left), 0.9), (found(right), 0.9))
    assert len(union_of([both, scout((found(left), 0.9))])) == 2
    assert len(union_of([scout((found(left), 0.9)), scout((found(right), 0.8))])) == 1
    far = replace(drag(axle=9), location={'axle': 9, 'side': 'right'})
    assert len(union_of([scout((found(left), 0.9)), scout((found(far), 0.8))])) == 2


def test_what_other_recordings_confirm_is_surer_and_its_size_is_everybodys():
    groups = union_of([scout((found(drag(130.0), 2.0), 0.6))])
    (joint,) = decide(groups, 4, [other((drag(120.0), 2.0)) for _ in range(12)])
    assert joint.probability >= 0.97
    assert joint.found.proposal.parameters['force_N'] == pytest.approx(120.8, abs=0.5)
    assert joint.recordings == 13


def test_what_other_recordings_do_not_find_is_not_accepted():
    groups = union_of([scout((found(drag(120.0)), 0.99)), scout((found(drag(120.0)), 0.99))])
    assert decide(groups, 4, [other((drag(8.0), 3.0)) for _ in range(12)]) == []
    # of the other sign neither
    assert decide(groups, 4, [other((drag(-100.0), 3.0)) for _ in range(12)]) == []


def test_recordings_that_cannot_tell_leave_it_to_the_scouts():
    blind = [other((drag(20.0), 200.0)) for _ in range(3)]
    assert decide(union_of([scout((found(drag()), 0.9))]), 4, blind) == []
    two = union_of([scout((found(drag()), 0.9)), scout((found(drag()), 0.8))])
    (joint,) = decide(two, 4, blind)
    assert joint.probability == pytest.approx(1.0 - 0.1 * 0.2)


@pytest.mark.parametrize(
    ('theirs', 'sd', 'recordings'),
    [(8.0, 3.0, []), (110.0, 3.0, [2]), (20.0, 200.0, [1])],
    ids=['has it not', 'has it', 'cannot tell'],
)
def test_a_search_that_does_not_name_an_effect_may_contradict_one_that_does(
    theirs, sd, recordings
):
    groups = union_of([scout((found(drag()), 0.9)), scout()])
    silent = [[(drag(theirs), {'force_N': sd})]]
    assert [j.recordings for j in decide(groups, 2, [], silent)] == recordings


@pytest.mark.parametrize(('theirs', 'accepted'), [(-4.0, True), (-0.5, False)])
def test_a_turned_sensor_is_held_by_its_largest_angle(theirs, accepted):
    """The angle that is about none is found with either sign, and says nothing."""

    def turned(x, y):
        angles = {'x_deg': x, 'y_deg': y}
        return Proposal('accelerometer_misalignment', {}, angles, 180.0, fitted=tuple(angles))

    sds = {'x_deg': 0.02, 'y_deg': 0.02}
    groups = union_of([scout((Found(turned(0.1, -4.0), 0.9, sds, 180.0, ()), 0.9))])
    others = [SimpleNamespace(effects=(turned(-0.1, theirs),), sd=(sds,)) for _ in range(5)]
    joint = decide(groups, 4, others)
    assert [j.recordings for j in joint] == [6] * accepted


def test_with_nobody_to_confirm_one_of_many_is_not_enough():
    one = union_of([scout((found(drag()), 0.9))])
    assert decide(one, 4, []) == []
    assert len(decide(one, 2, [])) == 1
    assert decide([], 4, []) == []


def test_scouts_are_the_corners_of_the_plan():
    plan = [
        Experiment(speed, way, (load,), preload)
        for speed, way, load, preload in product(
            (0.25, 0.5), (1, -1), (0.0, 75.0), (3000.0, 6000.0)
        )
    ]
    chosen = choose_scouts(plan)
    assert len(set(chosen)) == 4
    for name in ('set_speed_m_s', 'direction', 'load_per_step_kg', 'preload_n'):
        assert len({getattr(plan[k], name) for k in chosen}) == 2, name
    assert choose_scouts(plan[:3]) == [0, 1, 2]
    assert len(choose_scouts([None] * 6)) == 4


def test_faults_of_single_recordings_are_told_with_their_number():
    gap = Fault('data_gap', {'channels': ['a/b']}, {'from_s': (3.0, 2.9, 3.1)})
    late = Fault('data_gap', {'channels': ['a/b']}, {'from_s': (5.0, 4.9, 5.1)})
    (effect,) = told_jointly([], [[gap], [], [late]], 3)
    assert (effect['recordings'], effect['of']) == (2, 3)
    assert effect['parameters']['from_s'] == {'value': 4.0, 'low': 2.9, 'high': 5.1}


def held(gain, chi2):
    row = {'chi2_before': 4.0, 'chi2_after': chi2}
    return SimpleNamespace(held_out=HeldOut('', 12, {'a/b': row}, gain - 0.01, gain + 0.01))


def test_gain_is_over_recordings_that_no_size_was_fitted_to():
    gain = joint_gain([held(0.5, 1.0), held(0.6, 2.0), held(0.7, 3.0)], 1)['held_out']
    assert gain['blocks'] == 3
    assert gain['channels']['a/b'] == {'chi2_before': 4.0, 'chi2_after': 2.0}
    assert gain['significant']
    low, high = gain['gain_interval']
    assert 0.49 < low < 0.6 < high < 0.71
    doubtful = joint_gain([held(0.4, 1.0), held(-0.5, 5.0), held(-0.1, 4.0)], 1)
    assert not doubtful['held_out']['significant']
    assert joint_gain([], 1)['held_out'] is None


def test_what_all_first_scouts_name_is_suggested_to_the_others():
    turning = replace(drag(axle=7), parameters={'force_N': 90.0, 'phase_rad': 1.0})
    one = scout(
        (found(drag(118.0)), 0.9), (found(turning), 0.9), (found(drag(axle=9)), 0.9),
    )  # fmt: skip
    two = scout((found(drag(122.0)), 0.8), (found(turning), 0.9), (found(drag(axle=9)), 0.3))
    (suggested,) = shared_by([one, two])
    assert suggested.location['axle'] == 44
    assert suggested.parameters['force_N'] == pytest.approx(120.0)


def test_of_what_turns_an_eccentric_roller_alone_is_suggested():
    """Two runs tell the phase of a sine; a flat spot has many, and a drive's wave its frequency."""
    own = {'phase_rad': 1.0, 'slip': 1e-4}
    place = {'axle': 9, 'side': 'left'}
    roller, flat = (
        Proposal(cause, place, {size: 4e-4, **own}, 1e3, fitted=(size, *own))
        for cause, size in (('roller_eccentricity', 'amplitude_m'), ('roller_flat', 'depth_m'))
    )
    wave = Proposal(
        'drive_hunting', {}, {'relative_amplitude': 0.01, 'phase_rad': 1.0}, 1e3,
        fitted=('relative_amplitude', 'phase_rad'),
    )  # fmt: skip
    scouts = [scout((found(roller), 0.9), (found(flat), 0.9), (found(wave), 0.9))] * 2
    assert [effect.cause for effect in shared_by(scouts)] == [roller.cause]
