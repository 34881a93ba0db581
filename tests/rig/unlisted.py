"""Effects that are on no list: the twin must say that it cannot name them.

``UNLISTED`` changes the machine, ``UNLISTED_FAULTS`` the measurement; every name begins with
``unlisted_``.
"""

from dataclasses import replace

import numpy as np

from rig.causes import (
    Alter,
    changed,
    distance_on_loop,
    in_stretch,
    SIDE_INDEX,
    table_s,
)
from rig.faults import Fault
from rig.instruments import LINKS
from rig.machine import slope

KINK_LENGTH_M = 0.6  # m, over which the lateral line leaves and returns
BLOW_WIDTH_S = 0.03  # s, of a half sine


def stiffening_spring(model, _place, size, _rng):
    """Let the tensioner's spring stiffen: an extra force of ``cubic_n_m3`` times u cubed."""
    return model._replace(tens_k3=float(size['cubic_n_m3']))


def rubbing_brake(model, place, size, _rng):
    """Let a pad rub on the rollers of a stretch for ``on_s`` out of every ``period_s``."""
    return model._replace(
        rub_force=float(size['force_N']),
        rub_from=place['s_from_m'],
        rub_to=place['s_to_m'],
        rub_period=float(size['period_s']),
        rub_on=float(size['on_s']),
    )


def blows(model, _place, size, _rng):
    """Let something strike the carriage at a fixed interval."""
    return model._replace(
        blow_force=float(size['force_N']),
        blow_period=float(size['period_s']),
        blow_width=BLOW_WIDTH_S,
    )


def soft_support(model, place, size, _rng):
    """Let the guide's support be soft in a stretch: the contact's stiffness times a factor."""
    support = model.support.copy()
    for a in SIDE_INDEX[place['side']]:
        support[a, in_stretch(model, place)] *= size['factor']
    return model._replace(support=support)


def bent_axle(model, place, size, _rng):
    """Let an axle's ends stand apart along the path by ``offset_m`` when unloaded."""
    where = [int(place['axle'])]
    return model._replace(bend=changed(model.bend, where, lambda v: v + size['offset_m']))


def second_mode(model, _place, size, _rng):
    """Let the frame swing along the path's x axis in one mode."""
    omega = 2.0 * np.pi * size['frequency_hz']
    mass = size['modal_mass_kg']
    return model._replace(
        mode_x=1.0,
        mode_z=0.0,
        mode_mass=mass,
        mode_k=mass * omega**2,
        mode_c=2.0 * size['damping_ratio'] * mass * omega,
    )


def swinging_load(model, _place, size, _rng):
    """Let the weight of every load swell and sink together."""
    return model._replace(
        swing=float(size['relative_amplitude']), swing_hz=float(size['frequency_hz'])
    )


def slipping_dog(model, _place, size, _rng):
    """Let a dog yield wherever it would pull an axle end harder than ``force_N``."""
    return model._replace(slip_force=float(size['force_N']))


def misplaced_dog(model, _place, size, _rng):
    """Let one dog out of ``dogs`` on the rack stand ``offset_m`` from its place."""
    return model._replace(
        rack_dogs=int(size['dogs']), bad_dog=0, bad_dog_m=float(size['offset_m'])
    )


def leaking_preload(model, _place, size, _rng):
    """Let the preload sink at a relative rate of ``rate_1_s``."""
    return model._replace(preload_rate=-float(size['rate_1_s']))


def lateral_kink(model, place, size, _rng):
    """Let the guide's lateral line swing out by ``offset_m`` and back."""
    away = distance_on_loop(model, table_s(model), place['s_m'])
    bump = np.where(
        np.abs(away) < 0.5 * KINK_LENGTH_M,
        0.5 * (1.0 + np.cos(2.0 * np.pi * away / KINK_LENGTH_M)),
        0.0,
    )
    lateral = model.lateral + size['offset_m'] * bump
    return model._replace(lateral=lateral, lateral_slope=slope(lateral, model.cell))


def worn_channel(model, place, size, _rng):
    """Let the roller have more play in a stretch of the channel."""
    play = model.half_play.copy()
    for a in SIDE_INDEX[place['side']]:
        play[a, in_stretch(model, place)] += 0.5 * size['play_m']
    return model._replace(half_play=play)


UNLISTED: dict[str, Alter] = {
    'unlisted_stiffening_spring': stiffening_spring,
    'unlisted_rubbing_brake': rubbing_brake,
    'unlisted_blows': blows,
    'unlisted_soft_support': soft_support,
    'unlisted_bent_axle': bent_axle,
    'unlisted_second_mode': second_mode,
    'unlisted_swinging_load': swinging_load,
    'unlisted_slipping_dog': slipping_dog,
    'unlisted_misplaced_dog': misplaced_dog,
    'unlisted_leaking_preload': leaking_preload,
    'unlisted_lateral_kink': lateral_kink,
    'unlisted_worn_channel': worn_channel,
}


def crosstalk(signals, place, size, _rng):
    """Let one link's gauges pick up a share of another's."""
    strain = signals.strain.copy()
    to, source = (LINKS.index(name) for name in place['links'])
    strain[to] += size['share'] * (signals.strain[source] - signals.strain[source].mean(axis=0))
    return replace(signals, strain=strain)


def sticking_reflex(signals, _place, size, _rng):
    """Let the reflex sensor's reading lag behind by a dead band."""
    seen = signals.displacement.copy()
    half = 0.5 * size['band_m']
    for i in range(1, seen.size):
        seen[i] = min(max(seen[i - 1], seen[i] - half), seen[i] + half)
    return replace(signals, displacement=seen)


UNLISTED_FAULTS: dict[str, Fault] = {
    'unlisted_crosstalk': Fault(signals=crosstalk),
    'unlisted_sticking_reflex': Fault(signals=sticking_reflex),
}
