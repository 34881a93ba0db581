"""Effects that are on no list: the twin must say that it cannot name them.

``UNLISTED`` changes the machine; ``unlisted_faults.py`` has the measurement's.  Every name begins
with ``unlisted_``.
"""

import numpy as np

from rig.causes import (
    all_ends_of,
    Alter,
    bump_at,
    changed,
    in_stretch,
    SIDE_INDEX,
    table_s,
    with_landings,
    with_normal,
)
from rig.machine import slope
from rig.unlisted_in_time import IN_TIME

KINK_LENGTH_M = 0.6  # m, over which the lateral line leaves and returns
JOINT_M = 0.06  # m, over which a rail's end rises to the next one's


def stiffening_spring(model, _place, size, _rng):
    """Let the tensioner's spring stiffen: an extra force of ``cubic_n_m3`` times u cubed."""
    return model._replace(tens_k3=float(size['cubic_n_m3']))


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


def slipping_dog(model, _place, size, _rng):
    """Let a dog yield wherever it would pull an axle end harder than ``force_N``."""
    return model._replace(slip_force=float(size['force_N']))


def misplaced_dog(model, _place, size, _rng):
    """Let one dog out of ``dogs`` on the rack stand ``offset_m`` from its place."""
    return model._replace(
        rack_dogs=int(size['dogs']), bad_dog=0, bad_dog_m=float(size['offset_m'])
    )


def lateral_kink(model, place, size, _rng):
    """Let the guide's lateral line swing out by ``offset_m`` and back."""
    bump = bump_at(model, place['s_m'], KINK_LENGTH_M)
    lateral = model.lateral + size['offset_m'] * bump
    return model._replace(lateral=lateral, lateral_slope=slope(lateral, model.cell))


def worn_channel(model, place, size, _rng):
    """Let the roller have more play in a stretch of the channel."""
    play = model.half_play.copy()
    for a in SIDE_INDEX[place['side']]:
        play[a, in_stretch(model, place)] += 0.5 * size['play_m']
    return model._replace(half_play=play)


def settled_rail(model, place, size, _rng):
    """Let the rail sink by ``depth_m`` over ``length_m``, much longer than a joint's bump."""
    dip = bump_at(model, place['s_m'], size['length_m'])
    return with_normal(model, place['side'], -size['depth_m'] * dip)


def corrugated_rail(model, place, size, _rng):
    """Let a stretch of the rail be wavy: ``amplitude_m``, ``wavelength_m`` from crest to crest."""
    s = table_s(model)
    waves = np.sin(2.0 * np.pi * (s - place['s_from_m']) / size['wavelength_m'])
    return with_normal(
        model, place['side'], size['amplitude_m'] * waves * in_stretch(model, place)
    )


def high_rail(model, place, size, _rng):
    """Let a piece of rail lie ``height_m`` too high from joint to joint."""
    s = table_s(model)
    from_end = np.minimum(s - place['s_from_m'], place['s_to_m'] - s)
    return with_normal(
        model, place['side'], size['height_m'] * np.clip(from_end / JOINT_M + 0.5, 0.0, 1.0)
    )


def dry_side(model, place, size, _rng):
    """Let the rollers of one side alone roll harder."""
    where = all_ends_of(model, place['side'])
    return model._replace(
        resistance=changed(model.resistance, where, lambda v: v * size['factor'])
    )


def poor_batch(model, place, size, _rng):
    """Let every ``one_of``-th axle's rollers drag: one delivery of poor bearings."""
    half = model.mass.size // 2
    first, every = int(place['axle']), int(size['one_of'])
    where = [a * half + i for a in (0, 1) for i in range(first % every, half, every)]
    return model._replace(
        extra_drag=changed(model.extra_drag, where, lambda v: v + size['force_N'])
    )


def alternating_links(model, _place, size, _rng):
    """Let every second link be longer by ``length_m`` and its neighbours shorter."""
    half = model.mass.size // 2
    sign = np.where(np.arange(2 * half) % half % 2 == 0, 1.0, -1.0)
    return model._replace(rest=model.rest + sign * size['length_m'])


def soft_side(model, place, size, _rng):
    """Let all links of one side be softer."""
    where = all_ends_of(model, place['side'])
    return model._replace(link_k=changed(model.link_k, where, lambda v: v * size['factor']))


def damped_tensioner(model, _place, size, _rng):
    """Let the carriage be damped ``factor`` times as strongly."""
    return model._replace(tens_c=model.tens_c * size['factor'])


def heavy_carriage(model, _place, size, _rng):
    """Let the carriage be heavier by ``mass_kg``."""
    return model._replace(carriage_mass=model.carriage_mass + size['mass_kg'])


def uneven_loads(model, _place, size, rng):
    """Let every step's load be another one, by a share of ``sd`` about what it should be."""
    half = model.mass.size // 2
    uneven = np.tile(1.0 + size['sd'] * rng.standard_normal(half), 2)
    return model._replace(load=model.load * np.maximum(uneven, 0.0))


def heavy_side(model, place, size, _rng):
    """Let all axle ends of one side be heavier."""
    where = all_ends_of(model, place['side'])
    return model._replace(mass=changed(model.mass, where, lambda v: v * size['factor']))


def half_loaded(model, _place, size, _rng):
    """Let passengers step off before the top: the load's stretch ends ``early_m`` sooner."""
    return model._replace(load_to=model.load_to - size['early_m'])


def thick_grease(model, _place, size, _rng):
    """Let every roller's viscous drag be ``factor`` times as large."""
    return model._replace(viscous=model.viscous * size['factor'])


def damped_links(model, _place, size, _rng):
    """Let every link be damped ``factor`` times as strongly."""
    return model._replace(link_c=model.link_c * size['factor'])


def lower_landing(model, _place, size, _rng):
    """Lay the lower landing longer by ``delta_m``."""
    return with_landings(model, lower_m=size['delta_m'])


def short_dogs(model, _place, size, _rng):
    """Let the rack take hold later and let go earlier by ``short_m``."""
    return model._replace(
        drive_from=model.drive_from + size['short_m'], drive_to=model.drive_to - size['short_m']
    )


def graded_chain(model, _place, size, _rng):
    """Let the links' lengths vary by ``length_m`` in one wave round the chain, as two lots joined."""
    half = model.mass.size // 2
    wave = np.tile(np.sin(2.0 * np.pi * np.arange(half) / half), 2)
    return model._replace(rest=model.rest + size['length_m'] * wave)


def soft_tyres(model, _place, size, _rng):
    """Let every roller's tyre be softer."""
    return model._replace(contact_k=model.contact_k * size['factor'])


def soft_flanks(model, _place, size, _rng):
    """Let every axle be guided sideways less stiffly."""
    return model._replace(lat_k=model.lat_k * size['factor'])


def rail_joints(model, place, size, _rng):
    """Let a rail's end stand out ``height_m`` at each of its joints, ``spacing_m`` apart."""
    length = model.cell * model.lateral.size
    joints = np.arange(place['s_m'] % size['spacing_m'], length - JOINT_M, size['spacing_m'])
    bumps = sum(bump_at(model, s, JOINT_M) for s in joints)
    return with_normal(model, place['side'], size['height_m'] * bumps)


UNLISTED: dict[str, Alter] = {
    **IN_TIME,
    'unlisted_stiffening_spring': stiffening_spring,
    'unlisted_soft_support': soft_support,
    'unlisted_bent_axle': bent_axle,
    'unlisted_second_mode': second_mode,
    'unlisted_slipping_dog': slipping_dog,
    'unlisted_misplaced_dog': misplaced_dog,
    'unlisted_lateral_kink': lateral_kink,
    'unlisted_worn_channel': worn_channel,
    'unlisted_settled_rail': settled_rail,
    'unlisted_corrugated_rail': corrugated_rail,
    'unlisted_high_rail': high_rail,
    'unlisted_dry_side': dry_side,
    'unlisted_poor_batch': poor_batch,
    'unlisted_alternating_links': alternating_links,
    'unlisted_soft_side': soft_side,
    'unlisted_damped_tensioner': damped_tensioner,
    'unlisted_heavy_carriage': heavy_carriage,
    'unlisted_uneven_loads': uneven_loads,
    'unlisted_heavy_side': heavy_side,
    'unlisted_half_loaded': half_loaded,
    'unlisted_thick_grease': thick_grease,
    'unlisted_damped_links': damped_links,
    'unlisted_lower_landing': lower_landing,
    'unlisted_short_dogs': short_dogs,
    'unlisted_graded_chain': graded_chain,
    'unlisted_soft_tyres': soft_tyres,
    'unlisted_soft_flanks': soft_flanks,
    'unlisted_rail_joints': rail_joints,
}
