"""What other recordings named is tried in one more before anything is sought there."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from escalator_twin.diagnosis.found import Found
from escalator_twin.diagnosis.leftovers import perhaps_of
from escalator_twin.diagnosis.polish import Polished
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.suggested import begun, held, Suggested
from escalator_twin.diagnosis.verdict import Weighed

pytestmark = pytest.mark.issue(7)

DRAGGING = Proposal(
    'roller_drag', {'axle': 44, 'side': 'left'}, {'force_N': 120.0}, 1e3, fitted=('force_N',)
)
LANDING = Proposal(
    'landing_length', {'which': 'upper'}, {'delta_m': 6e-3}, 1e3, fitted=('delta_m',)
)
CHAIN = Proposal(
    'chain_elongation', {'side': 'both'}, {'length_m': 1e-4}, 1e3, fitted=('length_m',)
)
DRAG, LAND, LONG = DRAGGING.cause, LANDING.cause, CHAIN.cause
SURE = {DRAG: {'force_N': 5.0}, LAND: {'delta_m': 2e-4}, LONG: {'length_m': 1e-6}}


def found(effect):
    return Found(effect, 0.9, SURE[effect.cause], 500.0, ())


def scout(pairs):
    return SimpleNamespace(found=pairs)


class Fits:
    """Stands in for a fit of effects, whose spreads are known; tells what it was asked for."""

    def __init__(self, spreads, sizes=None):
        self.spreads, self.sizes, self.asked = spreads, sizes or {}, []

    def __call__(self, _context, _place, effects, _jobs):
        self.asked.append([e.cause for e in effects])
        fitted = tuple(
            replace(
                e, parameters={e.fitted[0]: self.sizes.get(e.cause, e.parameters[e.fitted[0]])}
            )
            for e in effects
        )
        return Polished(None, None, fitted, tuple(self.spreads[e.cause] for e in effects))


@pytest.mark.parametrize(('sds', 'kept'), [((5.0, 0.2), 2), ((5.0, 4.0), 0)])
def test_a_suggestion_counts_where_a_recording_has_all_of_it(sds, kept):
    effects = (DRAGGING, LANDING)
    spreads = ({'force_N': sds[0]}, {'delta_m': sds[1] * 1e-3})
    fits = Fits({e.cause: spread for e, spread in zip(effects, spreads, strict=True)})
    known = begun(fits, None, None, [], Suggested(effects))
    assert (known is None) if not kept else [f.proposal for f in known[1]] == list(effects)


def test_a_suggestion_of_which_a_recording_says_nothing_does_not_count():
    effects = (DRAGGING, replace(DRAGGING, location={'axle': 9, 'side': 'left'}))
    spreads = ({'force_N': 5.0}, {})
    assert [f is not None for f in held(Polished(None, None, effects, spreads))] == [True, False]


@pytest.mark.parametrize(
    ('spreads', 'sizes', 'asked', 'kept'),
    [
        ({}, {}, [[DRAG, LAND, LONG]], [DRAG, LAND, LONG]),
        # one of what one recording alone named is none here: the others are fitted without
        (
            {LAND: {'delta_m': 4e-3}}, {},
            [[DRAG, LAND, LONG], [DRAG, LONG]], [DRAG, LONG],
        ),
        # of another sign, or much larger, it is another one
        ({}, {LAND: -6e-3}, [[DRAG, LAND, LONG], [DRAG, LONG]], [DRAG, LONG]),
        ({}, {LAND: 2e-2}, [[DRAG, LAND, LONG], [DRAG, LONG]], [DRAG, LONG]),
        # they may have taken what all name: once more without them, and then that alone decides
        ({DRAG: {'force_N': 80.0}}, {}, [[DRAG, LAND, LONG], [DRAG]], None),
    ],
)  # fmt: skip
def test_what_one_recording_alone_names_is_tested_by_itself(spreads, sizes, asked, kept):
    fits = Fits({**SURE, **spreads}, sizes)
    known = begun(fits, None, None, [], Suggested((DRAGGING,), (LANDING, CHAIN)))
    assert fits.asked == asked
    assert (known and [f.proposal.cause for f in known[1]]) == kept


def test_what_one_of_the_first_names_beside_what_both_do_is_tried_perhaps():
    both, *more = ((found(effect), 0.9) for effect in (DRAGGING, LANDING, CHAIN))
    assert perhaps_of([scout((both, *more)), scout((both,))]) == [LANDING, CHAIN]
    assert perhaps_of([scout((both,)), scout((both, more[0]))]) == [LANDING]
    # two that name different things: one of them is wrong
    assert perhaps_of([scout((both, more[0])), scout((both, more[1]))]) == []
    # nothing that both name says that this is the same machine
    assert perhaps_of([scout((both,)), scout(())]) == []
    assert perhaps_of([scout((both,)), scout((both,))]) == []


def test_nothing_is_tried_that_may_have_been_taken_for_something_else():
    both = (found(DRAGGING), 0.9)
    rival = Weighed(CHAIN, 900.0, 449.0, 0.3)
    own = Weighed(LANDING, 900.0, 450.0, 0.7)
    doubtful = replace(found(LANDING), rivals=(own, rival))
    assert perhaps_of([scout((both, (doubtful, 0.7))), scout((both,))]) == []
