"""What can be hidden in a recording: each cause's places and sizes, drawn from a seed.

``share`` scales a cause's size from its reference: 1 is the reference, 1/3 and 2 the others.
Lengths, forces and amplitudes scale in proportion, factors by their distance from 1; a factor
that softens (a link, the drive, a support) scales as its logarithm, since twice 0.3 taken off
would leave nothing.  A frame's modal mass scales as 1 / share: half as heavy moves twice as
much.  Parameters that tell kind rather than size (frequencies, counts of teeth) do not scale.
"""

import numpy as np

from rig.catalogue_unlisted import NOT_LISTED
from rig.instruments import LINKS
from rig.make import Effect
from rig.places import (
    any_link,
    any_s,
    ANY_SIDE,
    at_roller,
    between,
    either,
    factor,
    in_stretch,
    Kind,
    of_machine,
    ONE_SIDE,
    pick,
    Random,
    softer,
    times,
)
from rig.sheet import chosen

SHARES = {'third': 1.0 / 3.0, 'reference': 1.0, 'twice': 2.0}
GAUGED_CHANNELS = tuple(f'link_force/{link}' for link in LINKS)
SPIKY_CHANNELS = (
    *GAUGED_CHANNELS,
    'tensioner/displacement',
    *(f'step/acceleration/{axis}' for axis in 'xyz'),
)
GAP_GROUPS = (  # what shares a topic is lost together
    *((channel,) for channel in GAUGED_CHANNELS),
    ('tensioner/displacement',),
    tuple(f'step/acceleration/{axis}' for axis in 'xyz'),
)


def link_elongation(rng: Random, share: float) -> tuple[dict, dict]:
    return {'link': any_link(rng)}, {'length_m': share * 3e-3}


def chain_elongation(rng: Random, share: float) -> tuple[dict, dict]:
    return {'side': pick(rng, ANY_SIDE)}, {'length_m': share * 1.5e-4}


def link_stiffness(rng: Random, share: float) -> tuple[dict, dict]:
    place = {'link': any_link(rng), 'side': pick(rng, ONE_SIDE)}
    return place, {'factor': softer(0.3, share)}


def guide_step(rng: Random, share: float) -> tuple[dict, dict]:
    place = {'s_m': any_s(rng), 'side': pick(rng, ANY_SIDE)}
    return place, {'height_m': share * 1.5e-3, 'length_m': rng.uniform(0.04, 0.08)}


def landing_length(rng: Random, share: float) -> tuple[dict, dict]:
    return {'which': 'upper'}, {'delta_m': share * pick(rng, (6e-3, -6e-3))}


def load_distribution(rng: Random, share: float) -> tuple[dict, dict]:
    first = any_link(rng)
    steps = [(first + k) % chosen().links for k in range(3)]
    # nothing is lighter than no load at all
    references = (0.0, 1.8) if share <= 1.0 else (1.8,)
    return {'steps': steps}, {'load_factor': factor(pick(rng, references), share)}


def step_mass(rng: Random, share: float) -> tuple[dict, dict]:
    # twice the reference lighter would leave less than the axles and rollers weigh
    signs = (1.0, -1.0) if share <= 1.0 else (1.0,)
    return {'step': any_link(rng)}, {'delta_kg': share * 18.0 * pick(rng, signs)}


def truss_resonance(rng: Random, share: float) -> tuple[dict, dict]:
    return {}, {
        'frequency_hz': rng.uniform(4.5, 8.0),
        'damping_ratio': 0.02,
        'modal_mass_kg': 4500.0 / share,
    }


def gauge_gain(rng: Random, share: float) -> tuple[dict, dict]:
    return {'link': pick(rng, LINKS)}, {'factor': factor(pick(rng, (1.09, 0.91)), share)}


def gauge_drift(rng: Random, share: float) -> tuple[dict, dict]:
    return {'link': pick(rng, LINKS)}, {'strain': share * 1e-5 * pick(rng, (1.0, -1.0))}


def gauge_dead(rng: Random, _share: float) -> tuple[dict, dict]:
    return {'link': pick(rng, LINKS), 'gauge': int(rng.integers(1, 5))}, {}


def misalignment(rng: Random, share: float) -> tuple[dict, dict]:
    turn = rng.normal(size=3)
    turn *= share * 4.0 / np.linalg.norm(turn)
    return {}, {f'{axis}_deg': float(turn[k]) for k, axis in enumerate('xyz')}


def axis_inverted(rng: Random, _share: float) -> tuple[dict, dict]:
    return {'axis': pick(rng, ('x', 'y', 'z'))}, {}


def channel_swap(rng: Random, _share: float) -> tuple[dict, dict]:
    one, other = rng.choice(4, 2, replace=False)
    return {'channels': [GAUGED_CHANNELS[one], GAUGED_CHANNELS[other]]}, {}


def clock_drift(rng: Random, share: float) -> tuple[dict, dict]:
    return {}, {'ppm': share * 900.0 * pick(rng, (1.0, -1.0))}


def mains_hum(rng: Random, share: float) -> tuple[dict, dict]:
    some = rng.permutation(4)[: int(rng.integers(1, 5))]
    links = [LINKS[k] for k in sorted(some)]
    return {'links': links}, {'strain': share * 6e-6, 'frequency_hz': pick(rng, (50.0, 60.0))}


def data_gap(rng: Random, share: float) -> tuple[dict, dict]:
    start = rng.uniform(10.0, 80.0)
    some = rng.permutation(len(GAP_GROUPS))[: int(rng.integers(1, len(GAP_GROUPS)))]
    channels = [channel for k in sorted(some) for channel in GAP_GROUPS[k]]
    return {'channels': channels}, {'from_s': start, 'to_s': start + share * 4.0}


def sensor_spikes(rng: Random, share: float) -> tuple[dict, dict]:
    return {'channel': pick(rng, SPIKY_CHANNELS)}, {'count': int(np.ceil(share * 20))}


LISTED: dict[str, Kind] = {
    'tensioner_friction': Kind(of_machine(force_N=times(150.0))),
    'tensioner_stiffness': Kind(of_machine(factor=either(0.7, 1.4))),
    'tensioner_preload': Kind(of_machine(factor=either(0.8, 1.25))),
    # resolved in make: where the motion's upper half is, only a run can tell
    'tensioner_stop': Kind(of_machine(share_of_motion=lambda _rng, share: 1.0 - share / 3.0)),
    'link_elongation': Kind(link_elongation),
    'chain_elongation': Kind(chain_elongation),
    'link_stiffness': Kind(link_stiffness),
    'roller_drag': Kind(at_roller('force_N', 120.0)),
    'roller_eccentricity': Kind(at_roller('amplitude_m', 4e-4)),
    'roller_flat': Kind(at_roller('depth_m', 6e-4)),
    'rolling_resistance': Kind(of_machine(factor=either(1.6, 0.6))),
    'friction_speed': Kind(of_machine(rise=times(1.2), speed_m_s=between(0.2, 0.2))),
    'guide_step': Kind(guide_step),
    'landing_length': Kind(landing_length),
    'guide_drag': Kind(in_stretch((1.0, 4.0), force_N=times(50.0))),
    'drive_ripple': Kind(
        of_machine(relative_amplitude=times(0.02), cycles_per_pitch=between(0.15, 0.85))
    ),
    'drive_hunting': Kind(
        of_machine(relative_amplitude=times(0.012), frequency_hz=between(0.1, 1.5))
    ),
    'drive_stiffness': Kind(of_machine(factor=lambda _rng, share: softer(0.25, share))),
    'load_distribution': Kind(load_distribution, needs_load=True),
    'load_offset': Kind(
        of_machine(left_share=lambda rng, share: 0.5 + share * pick(rng, (0.1, -0.1))),
        needs_load=True,
    ),
    'step_mass': Kind(step_mass),
    'truss_resonance': Kind(truss_resonance),
    'gauge_gain': Kind(gauge_gain),
    'gauge_drift': Kind(gauge_drift),
    'gauge_dead': Kind(gauge_dead, has_size=False),
    'accelerometer_misalignment': Kind(misalignment),
    'axis_inverted': Kind(axis_inverted, has_size=False),
    'channel_swap': Kind(channel_swap, has_size=False),
    'clock_drift': Kind(clock_drift),
    'mains_hum': Kind(mains_hum),
    'data_gap': Kind(data_gap),
    'sensor_spikes': Kind(sensor_spikes),
}

KINDS = {**LISTED, **NOT_LISTED}


def draw_effect(rng: Random, name: str, share: float) -> Effect:
    """Draw a cause's place and size."""
    location, parameters = KINDS[name].draw(rng, share)
    return Effect(name, location, parameters)
