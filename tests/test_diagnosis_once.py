"""A number of the machine that is found in two parts is told as one effect."""

import pytest

from escalator_twin.diagnosis.found import Found
from escalator_twin.diagnosis.once import told_once
from escalator_twin.diagnosis.proposals import Proposal

pytestmark = pytest.mark.issue(7)


def found(cause, location, parameters, fitted):
    return Found(Proposal(cause, location, parameters, 1e3, fitted=fitted), 0.99, {}, 1e3, ())


def preload(factor):
    return found('tensioner_preload', {}, {'factor': factor}, ('factor',))


def chain(length, side='left'):
    return found('chain_elongation', {'side': side}, {'length_m': length}, ('length_m',))


def test_factors_multiply():
    (one,) = told_once([preload(0.8218), preload(0.8913)])
    assert one.proposal.parameters['factor'] == pytest.approx(0.7325, abs=1e-4)
    assert one.gain == 2e3


def test_lengths_add_up_in_the_place_of_the_first():
    other = preload(0.8)
    one, kept = told_once([chain(1e-4), other, chain(5e-5)])
    assert one.proposal.parameters['length_m'] == pytest.approx(1.5e-4)
    assert kept is other


@pytest.mark.parametrize(
    'rows',
    [
        (chain(1e-4), chain(5e-5, 'right')),
        (preload(0.8),),
        (preload(0.8), chain(1e-4)),
        # two waves have the same cause, no place and numbers of their own
        tuple(
            found(
                'drive_ripple',
                {},
                {'relative_amplitude': 0.01, 'cycles_per_pitch': c},
                ('relative_amplitude', 'cycles_per_pitch'),
            )
            for c in (0.4, 0.7)
        ),
        # a gauge's fault is laid on what was measured: its numbers are its own
        tuple(
            found('gauge_gain', {'link': 'left_a'}, {'factor': f}, ('factor',)) for f in (1.1, 1.2)
        ),
    ],
)
def test_others_stay_as_they_are(rows):
    assert told_once(rows) == list(rows)
