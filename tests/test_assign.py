"""Which channel reads turned, and which another's, where links half a loop apart pull the opposite way."""

from dataclasses import replace

import numpy as np
import pytest

from escalator_twin.comparison.assign import mend_by_model
from escalator_twin.machine import load_machine
from escalator_twin.sync.template import Templates
from escalator_twin.sync.timeline import Timed

pytestmark = pytest.mark.issue(6)

SPEED_M_S, RATE_HZ = 0.5, 100.0
A, B, OTHER = 'link_force/left_a', 'link_force/right_b', 'link_force/left_b'
# What is measured is off the twin's by this share: more than its negative is off another link's.
OFF = 0.1


@pytest.fixture(scope='module')
def machine(root):
    """Return the prototype."""
    return load_machine(root / 'config' / 'machines' / 'prototype.yaml')


@pytest.fixture(scope='module')
def templates():
    """Return two links that pull the opposite way, but for a twelfth part of an amplitude, and one beside the second."""
    travel = np.arange(0.0, 48.0, SPEED_M_S / RATE_HZ)
    first, second = (np.sin(2.0 * np.pi * k * travel / 24.0) for k in (1, 2))
    columns = {A: first, B: 0.08 * second - first, OTHER: 0.09 * second - first}
    return Templates(travel, RATE_HZ, {c: 1e3 * v for c, v in columns.items()})


def told(machine, templates, wiring):
    """Return what is mended of channels that read others, by a sign, and the findings' kinds and channels."""
    wave = 1e3 * OFF * np.sin(2.0 * np.pi * 3.0 * templates.travel_m / 24.0)
    time = templates.travel_m / SPEED_M_S
    track = Timed('', time, time, np.ones(len(time), bool), RATE_HZ)
    tracks = {
        channel: replace(track, channel=channel, values=sign * (templates.columns[source] + wave))
        for channel, (source, sign) in wiring.items()
    }
    low = {c: t.values for c, t in tracks.items()}
    mended, findings = mend_by_model(tracks, low, templates, SPEED_M_S, 0.0, machine)
    for channel, found in mended.items():
        assert found.channel == channel
        np.testing.assert_allclose(found.values, templates.columns[channel] + wave)
    return [(f.kind, f.channel) for f in findings]


@pytest.mark.parametrize(
    ('signs', 'expected'),
    [
        ((1.0, 1.0), []),
        ((-1.0, 1.0), [('axis_inverted', A)]),
        ((-1.0, -1.0), [('axis_inverted', A), ('axis_inverted', B)]),
    ],
)
def test_what_is_turned_is_turned_back_and_exchanged_with_nothing(
    machine, templates, signs, expected
):
    wiring = {A: (A, signs[0]), B: (B, signs[1]), OTHER: (OTHER, 1.0)}
    assert sorted(told(machine, templates, wiring)) == expected


def test_what_is_exchanged_is_put_back_and_not_turned(machine, templates):
    wiring = {A: (B, 1.0), B: (A, 1.0), OTHER: (OTHER, 1.0)}
    assert told(machine, templates, wiring) == [('channel_swap', A)]
