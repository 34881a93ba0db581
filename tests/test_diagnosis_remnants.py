"""An effect at the wrong place, found first, beside the right one."""

from dataclasses import replace

import pytest

from escalator_twin.diagnosis.found import Found
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.remnants import without_remnants

pytestmark = pytest.mark.issue(6)


def accepted(proposal, sd, gain):
    return Found(proposal, 0.99, {proposal.fitted[0]: sd}, gain, ())


def flat(side, depth_m, axle=16):
    location = {'axle': axle, 'side': side}
    return Proposal('roller_flat', location, {'depth_m': depth_m}, 1e4, fitted=('depth_m',))


MIRRORED = accepted(flat('right', 9e-5), 3e-6, 16e3)  # 900 of its own
RIGHT_ONE = accepted(flat('left', 5e-4), 2e-6, 15e3)


def test_what_is_little_beside_a_later_one_of_its_cause_goes_and_its_gain_is_the_later_ones():
    (kept,) = without_remnants([MIRRORED, RIGHT_ONE])
    assert kept == replace(RIGHT_ONE, gain=pytest.approx(15e3 + 16e3 - 900.0))


@pytest.mark.parametrize(('depth_m', 'is_kept'), [(2.02e-4, True), (1.99e-4, False)])
def test_three_tenths_of_what_the_later_explains_are_an_effect(depth_m, is_kept):
    """Of 15 thousand 4500: 67.08 standard deviations of 3 micrometres."""
    first = replace(MIRRORED, proposal=flat('right', depth_m))
    kept = without_remnants([first, RIGHT_ONE])
    assert (first in kept) is is_kept


def test_size_is_counted_from_what_is_no_effect():
    spring = Proposal('tensioner_stiffness', {}, {'factor': 1.4}, 1e4, fitted=('factor',))
    first = accepted(replace(spring, parameters={'factor': 1.002}), 0.001, 9e3)  # 4 of chi squared
    later = accepted(spring, 0.001, 1e4)
    assert [one.proposal for one in without_remnants([first, later])] == [spring]


@pytest.mark.parametrize(
    'later',
    [
        accepted(Proposal('roller_drag', {'axle': 16}, {'force_N': 90.0}, 1e4, fitted=('force_N',)), 1.0, 15e3),
        replace(RIGHT_ONE, gain=2e3),
    ],
    ids=['another cause', 'a small one'],
)  # fmt: skip
def test_beside_another_cause_or_a_smaller_one_it_stays(later):
    assert without_remnants([MIRRORED, later]) == [MIRRORED, later]


def test_a_later_one_stays_beside_an_earlier_one():
    """That is asked when it is weighed."""
    assert without_remnants([RIGHT_ONE, MIRRORED]) == [RIGHT_ONE, MIRRORED]


@pytest.mark.parametrize('sd', [{}, {'depth_m': 0.0}], ids=['none', 'of none'])
def test_without_a_spread_nothing_is_said(sd):
    first = replace(MIRRORED, sd=sd)
    assert without_remnants([first, RIGHT_ONE]) == [first, RIGHT_ONE]


def test_a_second_one_that_stays_stays_where_the_first_goes():
    other = accepted(flat('left', 4e-4, axle=30), 2e-6, 14e3)
    kept = without_remnants([MIRRORED, other, RIGHT_ONE])
    assert [one.proposal for one in kept] == [other.proposal, RIGHT_ONE.proposal]
