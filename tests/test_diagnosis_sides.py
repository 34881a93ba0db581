"""The other side of what explains most is fitted too."""

from types import SimpleNamespace

import pytest

from escalator_twin.diagnosis import sides
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
