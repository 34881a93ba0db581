"""Each fault of the measurement that is on no list spoils what it says and nothing else."""

import numpy as np
import pytest
from rig.catalogue import KINDS
from rig.instruments import LINKS
from rig.recording import Signals
from rig.unlisted_faults import UNLISTED_FAULTS

OF_THE_REFLEX = ('sticking_reflex', 'reflex_gain', 'drifting_reflex', 'bent_reflex', 'held_reflex')
SLOW_S = 0.8  # s, a link's way between two axles


@pytest.fixture(scope='module')
def seen():
    """Return a minute of what a chain's instruments may see: a slow wave and a quick one."""
    onboard = np.arange(0.0, 60.0, 2e-3)
    ground = np.arange(0.0, 60.0, 1e-2)

    def wave(t, k):
        return np.sin(2.0 * np.pi * t / SLOW_S + k) + 0.3 * np.sin(2.0 * np.pi * 6.0 * t + 2 * k)

    strain = np.stack([np.stack([wave(onboard, k + g) for g in range(4)], 1) for k in range(4)])
    return Signals(
        onboard_s=onboard,
        ground_s=ground,
        strain=2e-4 + 5e-5 * strain,
        acceleration=np.stack([0.2 * wave(onboard, k) for k in range(3)], 1),
        displacement=2e-3 * wave(ground, 0),
        keep={},
    )


def spoiled(name, place):
    """Return which channels a fault at a place may touch."""
    if name.removeprefix('unlisted_') in OF_THE_REFLEX:
        return {'u'}
    if 'accel' in name:
        return {place['axis']} if 'axis' in place else {'x', 'y', 'z'}
    return {place['link'] if 'link' in place else place['links'][0]}


def by_channel(signals):
    links = dict(zip(LINKS, signals.strain, strict=True))
    axes = dict(zip('xyz', signals.acceleration.T, strict=True))
    return {**links, **axes, 'u': signals.displacement}


@pytest.mark.parametrize('name', sorted(UNLISTED_FAULTS))
def test_a_fault_spoils_what_it_says_and_nothing_else(name, seen):
    place, size = KINDS[name].draw(np.random.default_rng(2), 1.0)
    after = by_channel(UNLISTED_FAULTS[name].signals(seen, place, size, np.random.default_rng(3)))
    before = by_channel(seen)
    touched = {k for k in before if not np.array_equal(before[k], after[k])}
    assert touched == spoiled(name, place)
    for channel in touched:  # by more than rounding, by less than the channel itself
        share = np.std(after[channel] - before[channel]) / np.std(before[channel])
        assert 1e-3 < share < 1.5
