"""What can be hidden in a recording: each cause's places and sizes, drawn from a seed.

``share`` scales a cause's size from its reference: 1 is the reference, 1/3 and 2 the others.
Lengths, forces and amplitudes scale in proportion, factors by their distance from 1; a factor
that softens (a link, the drive, a support) scales as its logarithm, since twice 0.3 taken off
would leave nothing.  A frame's modal mass scales as 1 / share: half as heavy moves twice as
much.  Parameters that tell kind rather than size (frequencies, counts of teeth) do not scale.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from rig.instruments import LINKS
from rig.make import Effect

Random = np.random.Generator
Draw = Callable[[Random, float], tuple[dict[str, Any], dict[str, Any]]]

SHARES = {'third': 1.0 / 3.0, 'reference': 1.0, 'twice': 2.0}
LOOP_M = 24.4  # m, of places along the guide
RUN_M = (0.8, 10.2)  # m, of the passenger run that is loaded
ONE_SIDE = ('left', 'right')
ANY_SIDE = ('left', 'right', 'both')
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


@dataclass(frozen=True)
class Kind:
    """A cause that can be drawn; ``needs_load`` where an empty machine does not show it."""

    draw: Draw
    needs_load: bool = False
    has_size: bool = True


def pick(rng: Random, choices: tuple) -> Any:
    """Return one of the choices as it is."""
    return choices[int(rng.integers(len(choices)))]


def factor(reference: float, share: float) -> float:
    """Return a factor whose distance from 1 is the reference's times ``share``."""
    return 1.0 + share * (reference - 1.0)


def softer(reference: float, share: float) -> float:
    """Return a factor that stays above 0: the reference to the power ``share``."""
    return reference**share


def of_machine(**sizes: Callable[[Random, float], float]) -> Draw:
    """Return a draw without a place."""
    return lambda rng, share: ({}, {k: size(rng, share) for k, size in sizes.items()})


def at_roller(name: str, reference: float) -> Draw:
    """Return a draw of one roller."""

    def draw(rng: Random, share: float) -> tuple[dict, dict]:
        place = {'axle': int(rng.integers(60)), 'side': pick(rng, ONE_SIDE)}
        return place, {name: share * reference}

    return draw


def in_stretch(lengths_m: tuple[float, float], **sizes: Callable[[Random, float], float]) -> Draw:
    """Return a draw of a stretch of the guide that does not cross the seam."""

    def draw(rng: Random, share: float) -> tuple[dict, dict]:
        length = rng.uniform(*lengths_m)
        start = rng.uniform(0.0, LOOP_M - length)
        place = {'s_from_m': round(start, 2), 's_to_m': round(start + length, 2)}
        return place, {k: size(rng, share) for k, size in sizes.items()}

    return draw


def with_side(draw: Draw, sides: tuple[str, ...] = ANY_SIDE) -> Draw:
    """Return the draw with a side among its places."""

    def sided(rng: Random, share: float) -> tuple[dict, dict]:
        place, size = draw(rng, share)
        return {**place, 'side': pick(rng, sides)}, size

    return sided


def times(reference: float) -> Callable[[Random, float], float]:
    """Return a size in proportion to the share."""
    return lambda _rng, share: share * reference


def either(*references: float) -> Callable[[Random, float], float]:
    """Return a factor from one of several references."""
    return lambda rng, share: factor(pick(rng, references), share)


def between(low: float, high: float) -> Callable[[Random, float], float]:
    """Return a number that does not scale with the share."""
    return lambda rng, _share: float(rng.uniform(low, high))


def link_elongation(rng: Random, share: float) -> tuple[dict, dict]:
    return {'link': int(rng.integers(60))}, {'length_m': share * 3e-3}


def chain_elongation(rng: Random, share: float) -> tuple[dict, dict]:
    return {'side': pick(rng, ANY_SIDE)}, {'length_m': share * 1.5e-4}


def link_stiffness(rng: Random, share: float) -> tuple[dict, dict]:
    place = {'link': int(rng.integers(60)), 'side': pick(rng, ONE_SIDE)}
    return place, {'factor': softer(0.3, share)}


def guide_step(rng: Random, share: float) -> tuple[dict, dict]:
    place = {'s_m': round(rng.uniform(0.0, LOOP_M), 2), 'side': pick(rng, ANY_SIDE)}
    return place, {'height_m': share * 1.5e-3, 'length_m': rng.uniform(0.04, 0.08)}


def landing_length(rng: Random, share: float) -> tuple[dict, dict]:
    return {'which': 'upper'}, {'delta_m': share * pick(rng, (6e-3, -6e-3))}


def load_distribution(rng: Random, share: float) -> tuple[dict, dict]:
    first = int(rng.integers(60))
    steps = [(first + k) % 60 for k in range(3)]
    # nothing is lighter than no load at all
    references = (0.0, 1.8) if share <= 1.0 else (1.8,)
    return {'steps': steps}, {'load_factor': factor(pick(rng, references), share)}


def step_mass(rng: Random, share: float) -> tuple[dict, dict]:
    # twice the reference lighter would leave less than the axles and rollers weigh
    signs = (1.0, -1.0) if share <= 1.0 else (1.0,)
    return {'step': int(rng.integers(60))}, {'delta_kg': share * 18.0 * pick(rng, signs)}


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


def lateral_kink(rng: Random, share: float) -> tuple[dict, dict]:
    return {'s_m': round(rng.uniform(0.0, LOOP_M), 2)}, {'offset_m': share * 4e-3}


def bent_axle(rng: Random, share: float) -> tuple[dict, dict]:
    return {'axle': int(rng.integers(60))}, {'offset_m': share * 2e-3}


def crosstalk(rng: Random, share: float) -> tuple[dict, dict]:
    one, other = rng.choice(4, 2, replace=False)
    return {'links': [LINKS[one], LINKS[other]]}, {'share': share * 0.06}


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

NOT_LISTED: dict[str, Kind] = {
    'unlisted_stiffening_spring': Kind(of_machine(cubic_n_m3=times(1e9))),
    'unlisted_rubbing_brake': Kind(
        in_stretch(
            (1.0, 3.0), force_N=times(60.0), period_s=between(6.0, 12.0), on_s=between(2.0, 4.0)
        )
    ),
    'unlisted_blows': Kind(of_machine(force_N=times(1500.0), period_s=between(1.5, 4.0))),
    'unlisted_soft_support': Kind(
        with_side(in_stretch((1.0, 3.0), factor=lambda _rng, share: softer(0.15, share)))
    ),
    'unlisted_bent_axle': Kind(bent_axle),
    'unlisted_second_mode': Kind(
        of_machine(
            frequency_hz=between(8.0, 12.0),
            damping_ratio=between(0.02, 0.02),
            modal_mass_kg=lambda _rng, share: 3000.0 / share,
        )
    ),
    'unlisted_swinging_load': Kind(
        of_machine(relative_amplitude=times(0.08), frequency_hz=between(0.5, 1.5)), needs_load=True
    ),
    'unlisted_misplaced_dog': Kind(of_machine(dogs=between(7, 7), offset_m=times(1e-3))),
    'unlisted_slipping_dog': Kind(
        of_machine(
            share_of_peak=lambda _rng, share: 1.0 - 0.04 * share
        )  # more and the chain runs away
    ),
    'unlisted_leaking_preload': Kind(of_machine(rate_1_s=times(1e-3))),
    'unlisted_lateral_kink': Kind(lateral_kink),
    'unlisted_worn_channel': Kind(with_side(in_stretch((1.0, 3.0), play_m=times(1.5e-3)))),
    'unlisted_crosstalk': Kind(crosstalk),
    'unlisted_sticking_reflex': Kind(of_machine(band_m=times(2e-4))),
}

KINDS = {**LISTED, **NOT_LISTED}


def draw_effect(rng: Random, name: str, share: float) -> Effect:
    """Draw a cause's place and size."""
    location, parameters = KINDS[name].draw(rng, share)
    return Effect(name, location, parameters)
