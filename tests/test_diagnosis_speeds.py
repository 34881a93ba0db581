"""Several speeds tell a law of speed from one factor, and one speed does not."""

from math import exp

import numpy as np
import pytest

from escalator_twin.causes import apply
from escalator_twin.diagnosis.campaign import Joint
from escalator_twin.diagnosis.found import Found
from escalator_twin.diagnosis.jointly import by_speed, told_jointly
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.speeds import law_of, Rolled
from escalator_twin.machine import load_machine

pytestmark = pytest.mark.issue(7)

TOLERANCE = 0.1  # of the machine's own resistance, one standard deviation: the data sheet's
TWO_SPEEDS = [0.25] * 8 + [0.5] * 8


def recordings(seed, rise, own=1.0, speeds=TWO_SPEEDS, sd=0.04, fades=0.2):
    rng = np.random.default_rng(seed)
    return [
        Rolled(v, own * (1.0 + rise * exp(-v / fades)) + sd * rng.normal(), sd) for v in speeds
    ]


def factor(size):
    found = Found(
        Proposal('rolling_resistance', {}, {'factor': size}, 0.0, fitted=('factor',)),
        0.98,
        {'factor': 0.05},
        300.0,
        (),
    )
    return Joint(found, 0.98, 8)


def named(rows, joint=()):
    return {
        j.found.proposal.cause: j for j in by_speed(list(joint), law_of(rows, TOLERANCE), seed=0)
    }


@pytest.mark.parametrize('seed', range(8))
def test_a_law_of_speed_takes_the_place_of_a_factor(seed):
    """contracts.md's reference: a third more at 0.25 m/s, a tenth more at 0.5."""
    own = 1.0 + TOLERANCE * np.random.default_rng(100 + seed).normal()
    effects = named(recordings(seed, 1.2, own), [factor(1.34)])
    assert list(effects) == ['friction_speed']
    found = effects['friction_speed'].found
    assert found.proposal.parameters['rise'] == pytest.approx(1.2, abs=2.0 * found.sd['rise'])
    assert effects['friction_speed'].probability > 0.9


def test_a_law_of_speed_is_told_and_runs_as_contracts_have_it(root):
    joint = by_speed([], law_of(recordings(3, 1.2), TOLERANCE), seed=0)
    (told,) = told_jointly(joint, [], 16)
    assert told['cause'] == 'friction_speed'
    assert told['alternatives'] == []
    for name, true in (('rise', 1.2), ('speed_m_s', 0.2)):
        interval = told['parameters'][name]
        assert interval['low'] < true < interval['high']
    prototype = load_machine(root / 'config/machines/prototype.yaml')
    machine = apply(prototype, (joint[0].found.proposal.deviation,))
    assert machine.deviations[-1].cause == 'friction_speed'


@pytest.mark.parametrize('seed', range(20))
def test_one_factor_at_all_speeds_is_no_law(seed):
    own = 1.0 + 2.0 * TOLERANCE * np.random.default_rng(200 + seed).normal()
    assert not named(recordings(seed, 0.0, own))
    (kept,) = named(recordings(seed, 0.0, 1.6), [factor(1.6)]).values()
    assert kept.found.proposal.cause == 'rolling_resistance'
    assert kept.ruled_out == ('friction_speed',)


@pytest.mark.parametrize('speeds', [[0.5] * 16, [0.25]], ids=['one speed', 'one recording'])
def test_one_speed_tells_nothing(speeds):
    rows = recordings(0, 1.2, speeds=speeds)
    assert law_of(rows, TOLERANCE) is None
    (kept,) = named(rows, [factor(1.34)]).values()
    assert kept.ruled_out == ()


def test_a_rise_within_tolerance_is_not_named():
    rows = recordings(1, 0.25, sd=0.002)
    assert not named(rows)


def test_each_recording_is_foretold_by_the_others_alone():
    """One recording that is far off makes no gain for itself."""
    rows = recordings(2, 0.0)
    rows[0] = Rolled(0.25, 3.0, 0.04)
    assert not named(rows)


@pytest.mark.parametrize(('sd', 'share'), [(0.01, 0.17), (0.005, 0.09)])
def test_sixteen_recordings_at_two_speeds_cannot_tell_a_rise_to_ten_percent(sd, share):
    # Cramer and Rao: of r (1 + rise exp(-v / speed)), r known to its tolerance, every factor to `sd` of itself;
    # within 10 % in 19 of 20 campaigns takes a standard deviation of 5 %
    rise, fades = 1.2, 0.2
    speed = np.outer([0.25, 0.5], np.linspace(0.93, 1.07, 8)).ravel()
    law = np.exp(-speed / fades)
    slopes = np.stack([1.0 + rise * law, law, rise * law * speed / fades**2], axis=1)
    known = np.diag([1.0 / TOLERANCE**2, 0.0, 0.0])
    weighed = slopes / (sd * (1.0 + rise * law))[:, None]
    covariance = np.linalg.inv(weighed.T @ weighed + known)
    assert covariance[1, 1] ** 0.5 / rise == pytest.approx(share, abs=0.005)
