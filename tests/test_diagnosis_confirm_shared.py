"""One more recording that begins from the tolerances which other recordings of the machine have."""

from dataclasses import replace
from types import SimpleNamespace

import pytest
from searches import CHAIN, LINK

from escalator_twin.diagnosis import confirm
from escalator_twin.diagnosis.polish import Polished
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.settling import MOST_STEPS, WORTH_A_STEP

pytestmark = pytest.mark.issue(7)

STOOD = Proposal(
    'roller_eccentricity', {'axle': 41, 'side': 'left'},
    {'amplitude_m': 4e-4, 'phase_rad': 0.3, 'slip': 0.0}, 1e4, fitted=('amplitude_m',),
)  # fmt: skip
SHARED = {'chain.mass': 0.5}


def stand(level):
    return SimpleNamespace(stage=SimpleNamespace(judged=lambda *_: level), fitted=None)


@pytest.mark.parametrize(
    ('effects', 'steps', 'is_whole'),
    [([CHAIN], MOST_STEPS, False), ([CHAIN, LINK], 0, True), ([STOOD], 0, True)],
    ids=['the whole chain', 'a link', 'a roller'],
)
def test_what_single_links_do_is_in_the_runs_that_tell_of_tolerances(
    monkeypatch, effects, steps, is_whole
):
    asked = []

    def fit(_context, own, turned, free, **options):
        asked.append((own, turned, free, options))
        return 'fitted'

    def whole(fitted, free, **options):
        asked.append((fitted, free, options))
        return 'fitted with them'

    def tolerances(context, deviations, turned):
        assert deviations == tuple(e.deviation for e in effects)
        return context, turned

    monkeypatch.setattr(confirm, 'with_own_tolerances', tolerances)
    monkeypatch.setattr(confirm, 'polish', fit)
    monkeypatch.setattr(confirm, 'polish_whole', whole)
    found = confirm._beside_shared('context', effects, SHARED, 'free')
    own = tuple(replace(e, fitted=('phase_rad', 'slip') if e is STOOD else ()) for e in effects)
    assert asked[0] == (own, SHARED, 'free', {'steps': steps, 'is_near': True})
    if is_whole:
        options = {'worth': WORTH_A_STEP, 'steps': confirm.LOCAL_STEPS}
        assert asked[1:] == [('fitted', 'free', options)]
    assert found == ('fitted with them' if is_whole else 'fitted')


@pytest.mark.parametrize(
    ('effects', 'is_open', 'level', 'fits'),
    # beside none of them 900 is left
    [
        ([CHAIN], False, 300.0, True),
        ([CHAIN], True, 300.0, False),
        ([CHAIN, LINK], True, 300.0, True),
        ([CHAIN, LINK], True, 950.0, False),
    ],
)
def test_where_they_leave_something_open_it_is_tuned_by_itself(
    monkeypatch, effects, is_open, level, fits
):
    """Unless runs take the machine's whole length and are nearer than the machine as described."""
    monkeypatch.setattr(confirm, 'is_open', lambda *_: is_open)
    near = Polished(SimpleNamespace(floor=None), stand(level), tuple(effects), ())
    assert confirm._fits(near, effects, stand(900.0)) is fits
