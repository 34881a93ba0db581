"""The other side of what explains most is fitted too."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import expit
from scipy.stats import norm

from escalator_twin.diagnosis import sides
from escalator_twin.diagnosis.grids import Frame
from escalator_twin.diagnosis.polish import Polished
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.refine import Refined
from escalator_twin.diagnosis.tried import Tried

pytestmark = pytest.mark.issue(7)


@pytest.mark.parametrize(
    ('cause', 'alone', 'tried'),
    [
        ('roller_flat', 3.9e4, ['right']),
        ('roller_flat', 1.9e4, []),  # run once, it explains half as much: another thing
        ('roller_drag', 3.9e4, ['right']),
        ('step_mass', 3.9e4, []),
    ],
)
def test_the_other_side_of_the_best_is_fitted_too(monkeypatch, cause, alone, tried):
    stage = SimpleNamespace(turned={'racking': 1.2})
    fit = Polished(None, SimpleNamespace(stage=stage), (), ())
    left = Proposal(cause, {'axle': 38, 'side': 'left'}, {'x': 1.0}, 4e4)
    done = []

    def fitted_beside(_context, _place, _known, refined, turned, _jobs):
        done.append(refined.proposal.location['side'])
        assert turned == stage.turned  # from where the first one ended
        return Tried(refined.proposal, 5e4, {}, fit)

    monkeypatch.setattr(sides, 'fitted_beside', fitted_beside)
    refined = [Refined(left, None, None, 4e4, {}, None, ())]
    found = sides.other_sides(None, (), refined, [Tried(left, 4e4, {}, fit)], 1, lambda _: alone)
    assert done == tried
    assert [t.proposal.location['axle'] for t in found] == [38] * len(tried)


@pytest.mark.parametrize(
    ('known', 'cause', 'added'),
    [
        (('chain_elongation', {'side': 'left'}), 'link_stiffness', ['left']),
        (('load_offset', {}), 'link_stiffness', ['left']),
        (('chain_elongation', {'side': 'both'}), 'link_stiffness', []),  # both sides pull alike
        (('tensioner_friction', {}), 'link_stiffness', []),
        (('chain_elongation', {'side': 'left'}), 'roller_drag', []),  # whatever the side's tension
    ],
)
def test_a_soft_link_is_tried_on_both_sides_where_one_side_pulls_more(known, cause, added):
    one = Proposal(cause, {'link': 54, 'side': 'right'}, {'factor': 0.5}, 1.6e3)
    beside = Proposal(*known, {}, 9e6)
    found = sides.across([one], [beside])
    assert [p.location['side'] for p in found] == added
    assert all(p.location['link'] == 54 and p.parameters == one.parameters for p in found)
    # a contender already is none once more
    assert found == [] or sides.across([one, *found], [beside]) == []


FRAME = Frame(0.4, 20, 8, 0.5)
PITCHES = 30  # a loop and a half


def a_rails_step(side: str, gain: float, left: dict[int, float], s_m: float = 2.88) -> Tried:
    """Return one that leaves so much of chi squared at some pitches of travel, and nothing elsewhere."""
    step = Proposal('guide_step', {'s_m': s_m, 'side': side}, {'height_m': 1e-3}, 0.0)
    index = np.arange(PITCHES * FRAME.per_pitch)
    observation = SimpleNamespace(frame=FRAME, index=index)
    white = np.zeros((len(index), 2))
    for pitch, chi2 in left.items():
        white[pitch * FRAME.per_pitch + 3] = (0.6 * chi2) ** 0.5, (0.4 * chi2) ** 0.5
    place = SimpleNamespace(stage=SimpleNamespace(observation=observation), white=white)
    return Tried(step, gain, {}, Polished(None, place, (step,), ({},)))


@pytest.fixture
def along(monkeypatch):
    monkeypatch.setattr(sides, 'in_time', lambda place: place.white)


def place_of(tried: Tried) -> SimpleNamespace:
    return tried.polished.place


@pytest.mark.usefixtures('along')
@pytest.mark.parametrize(
    ('left', 'chance'),
    [
        ({5: 90.0}, 90.0),  # the whole difference is one blow: it might be none
        # both axles of a step, a pitch apart: blocks of two pitches hold one, both, one
        ({5: 90.0, 6: 90.0}, 3.0**0.5 * 90.0),
        ({5: 90.0, 9: 90.0}, 2.0**0.5 * 90.0),
        ({3: 90.0, 23: 90.0}, 180.0),  # the same place, a loop later
    ],
)
def test_a_difference_is_known_by_as_many_passages_as_it_came_about_in(left, chance):
    one, other = a_rails_step('both', 0.0, {}), a_rails_step('right', 0.0, left)
    assert sides.chance_of(place_of(other), place_of(one)) == pytest.approx(chance)
    assert sides.chance_of(place_of(one), place_of(other)) == pytest.approx(chance)


@pytest.mark.usefixtures('along')
def test_two_alignments_are_compared_where_both_have_been():
    one, other = a_rails_step('both', 0.0, {9: 50.0}), a_rails_step('right', 0.0, {9: 170.0})
    observation = place_of(other).stage.observation
    later = SimpleNamespace(frame=FRAME, index=observation.index[5:])
    moved = SimpleNamespace(
        stage=SimpleNamespace(observation=later), white=place_of(other).white[5:]
    )
    assert sides.chance_of(moved, place_of(one)) == pytest.approx(120.0)


@pytest.mark.usefixtures('along')
@pytest.mark.parametrize('blow', [4.0, 40.0, 400.0])
def test_sides_are_as_likely_as_the_logistic_over_a_normal(blow):
    """Half of chi squared is nats; the integral is a numerical one, which the approximation meets to 0.02."""
    tried = [a_rails_step('both', 700.0, {}), a_rails_step('right', 700.0 - blow, {5: blow})]
    both, right = sides.weighed_by_passages(tried)
    assert both is tried[0]
    wanted, _ = quad(
        lambda x: expit(0.5 * x) * norm.pdf(x, blow, blow), -8.0 * blow, 10.0 * blow, limit=400
    )
    assert expit(0.5 * (both.gain - right.gain)) == pytest.approx(wanted, abs=0.02)


@pytest.mark.usefixtures('along')
def test_what_many_passages_tell_is_believed():
    blows = dict.fromkeys(range(0, 20, 2), 400.0)
    tried = [a_rails_step('both', 7000.0, {}), a_rails_step('right', 3000.0, blows)]
    both, right = sides.weighed_by_passages(tried)
    assert both.gain - right.gain > 9.0


@pytest.mark.usefixtures('along')
@pytest.mark.parametrize(
    'other',
    [a_rails_step('right', 300.0, {5: 400.0}, s_m=9.0), a_rails_step('both', 300.0, {5: 400.0})],
)
def test_another_place_is_no_other_side(other):
    tried = [a_rails_step('both', 700.0, {}), other]
    assert sides.weighed_by_passages(tried) == tried
