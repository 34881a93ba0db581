"""What would change a verdict: between which explanations a further experiment is sought."""

from types import SimpleNamespace

import pytest

from escalator_twin.diagnosis.floor import Floor
from escalator_twin.diagnosis.found import Found
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.telling import would_change
from escalator_twin.diagnosis.verdict import Weighed

pytestmark = [pytest.mark.issue(6), pytest.mark.issue(7)]


OWN = SimpleNamespace(floor=Floor({}))


def a_step(side: str, s_m: float = 2.8794) -> Proposal:
    return Proposal('guide_step', {'s_m': s_m, 'side': side}, {'height_m': 1e-3}, 0.0)


FLAT = Proposal('roller_flat', {'axle': 3, 'side': 'left'}, {'depth_m': 6e-4}, 0.0)


@pytest.mark.parametrize(
    ('probability', 'rival', 'evidence', 'share', 'sought', 'said'),
    [
        (0.87, a_step('right'), 48.0, 0.13, 'right', 'guide_step at s_m 2.879, side both or at s_m 2.879, side right:'),
        (0.87, a_step('right'), 40.0, 0.01, None, 'guide_step or no effect:'),
        (0.87, a_step('both', 2.9), 49.0, 0.13, None, 'guide_step or no effect:'),  # the same one
        (0.8, FLAT, 49.0, 0.2, 'left', 'guide_step or roller_flat:'),
        (0.8, FLAT, 40.0, 0.2, None, 'guide_step or no effect:'),  # told apart
        (0.95, a_step('right'), 47.0, 0.05, None, None),
    ],
)  # fmt: skip
def test_an_experiment_is_sought_that_tells_the_likeliest_apart(
    probability, rival, evidence, share, sought, said
):
    own, asked = a_step('both'), []
    rivals = (
        Weighed(own, 100.0, 50.0, probability),
        Weighed(rival, 98.0, evidence, share),
    )
    found = Found(own, probability, {}, 100.0, rivals)

    def decide(_context, one, other):
        assert one is own
        asked.append(other and other.location['side'])
        return SimpleNamespace(text='0.25 m/s up, empty, preload 3000 N', nats=17.2)

    lines = would_change(OWN, SimpleNamespace(weighed=()), [(found, probability)], None, decide)
    assert asked == ([sought] if said else [])
    assert [line[: len(said or '')] for line in lines] == ([said] if said else [])
    assert all(line.endswith('would tell them apart by 17 nats at most') for line in lines)


def test_a_floor_of_another_machine_is_told():
    borrowed = SimpleNamespace(floor=Floor({}, borrowed='prototype'))
    (line,) = would_change(borrowed, SimpleNamespace(weighed=()), [], None)
    assert 'calibrate' in line
    assert line.endswith('that of prototype stands for it')
    assert would_change(OWN, SimpleNamespace(weighed=()), [], None) == []
