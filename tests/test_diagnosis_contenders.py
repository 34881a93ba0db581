"""Which proposals are worth a simulation."""

import pytest

from escalator_twin.diagnosis.contenders import choose
from escalator_twin.diagnosis.proposals import Proposal

pytestmark = pytest.mark.issue(6)


def at(place, cause='guide_step', gain=900.0):
    key, value, side = place
    return Proposal(cause, {key: value, 'side': side}, {'x': 1.0}, gain)


HERE = [('s_m', 5.0, 'right'), ('s_m', 5.01, 'both'), ('s_m', 4.99, 'left')]
THERE = [('s_m', 9.0, 'right'), ('s_m', 9.0, 'both')]


def test_a_rails_step_is_run_on_all_sides_of_the_best_place():
    proposals = [at(place, gain=900.0 - k) for k, place in enumerate([*HERE, *THERE])]
    assert choose(proposals) == proposals[:3]


def test_of_two_places_of_a_rails_step_further_sides_are_run_and_no_third_place():
    order = [HERE[0], THERE[0], ('s_m', 7.0, 'right'), HERE[1], THERE[1], HERE[2]]
    proposals = [at(place, gain=900.0 - k) for k, place in enumerate(order)]
    assert choose(proposals) == [proposals[k] for k in (0, 1, 3, 4)]


@pytest.mark.parametrize('cause', ['roller_flat', 'roller_drag'])
@pytest.mark.parametrize('third', [(5, 'left'), (3, 'right'), (3, 'left')])
def test_of_another_cause_two_are_run(cause, third):
    rows = [(3, 'left'), (4, 'left'), third]
    proposals = [at(('axle', *row), cause, 900.0 - k) for k, row in enumerate(rows)]
    assert choose(proposals) == proposals[:2]
