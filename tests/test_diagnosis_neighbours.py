"""The place of an effect among its neighbours."""

from types import SimpleNamespace

import pytest

from escalator_twin.diagnosis.neighbours import at_neighbours
from escalator_twin.diagnosis.polish import Polished
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.errors import EscalatorError

pytestmark = pytest.mark.issue(6)

LINKS = 60
CONTEXT = SimpleNamespace(machine=SimpleNamespace(chain=SimpleNamespace(n_links=LINKS)))


def soft(link):
    return Proposal('link_stiffness', {'link': link, 'side': 'left'}, {'factor': 0.3}, 3e3)


def left(chi2):
    stage = SimpleNamespace(judged=lambda fitted, _: fitted.chi2)
    return SimpleNamespace(stage=stage, fitted=SimpleNamespace(chi2=chi2))


@pytest.fixture
def moved():
    """Return where an effect ends that leaves so much by link, and where fits were made."""

    def move(leaves, one, before=()):
        fits = []

        def again(context, _place, known, _jobs):
            fits.append(known[-1].location.get('link'))
            assert list(known[:-1]) == list(before)
            if fits[-1] not in leaves:
                raise EscalatorError('no machine runs with it there')
            return Polished(context, left(leaves[fits[-1]]), tuple(known), ())

        begun = left(leaves.get(one.location.get('link'), 1e4))
        start = Polished(CONTEXT, begun, (*before, one), ())
        found = at_neighbours(again, start, [*before, one])
        return found.effects[-1].location.get('link'), fits, found is start

    return move


def test_it_goes_from_neighbour_to_neighbour_while_less_is_left(moved):
    assert moved({51: 11507, 52: 13550, 50: 8170, 49: 9298}, soft(51)) == (50, [50, 52, 49], False)


def test_where_neighbours_leave_more_it_stays(moved):
    assert moved({50: 8170, 49: 9298, 51: 11507}, soft(50)) == (50, [49, 51], True)


def test_link_0_and_the_last_one_are_neighbours(moved):
    assert moved({0: 90, 1: 95, 59: 70, 58: 80}, soft(0)) == (59, [59, 1, 58], False)


def test_beside_what_else_is_known(moved):
    drag = Proposal('guide_drag', {'s_from_m': 7.2, 's_to_m': 7.9}, {'force_N': 129.0}, 1.7e4)
    assert moved({7: 100, 8: 60, 6: 110, 9: 70}, soft(7), (drag,)) == (8, [6, 8, 9], False)


def test_where_no_machine_runs_it_stays(moved):
    assert moved({50: 8170}, soft(50)) == (50, [49, 51], True)


@pytest.mark.parametrize('cause', ['tensioner_friction', 'gauge_gain'])
def test_what_has_no_neighbours_stays(moved, cause):
    place = {'link': 'left_a'} if cause == 'gauge_gain' else {}
    assert moved({}, Proposal(cause, place, {}, 1.0))[1:] == ([], True)
