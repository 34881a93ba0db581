"""The causes of the machine: what is deliberately wrong, where, and how much of it.

Each entry of ``MACHINE_CAUSES`` turns a model into one with the cause.  Names, places and
sizes are those of the project's list of causes; the physics is the rig's own.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from rig.guide import lay_path
from rig.machine import slope
from rig.model import Model
from rig.sheet import chosen

Place = dict[str, Any]
Size = dict[str, float]
Alter = Callable[[Model, Place, Size, np.random.Generator], Model]

SIDE_INDEX = {'left': (0,), 'right': (1,), 'both': (0, 1)}


def ends_of(model: Model, index: int, side: str) -> list[int]:
    """Return the flat indices of an axle end or link on the named side or sides."""
    half = model.mass.size // 2
    return [a * half + int(index) for a in SIDE_INDEX[side]]


def all_ends_of(model: Model, side: str) -> list[int]:
    """Return the flat indices of all axle ends or links on the named side or sides."""
    half = model.mass.size // 2
    return [e for a in SIDE_INDEX[side] for e in range(a * half, (a + 1) * half)]


def changed(values: np.ndarray, where: list[int], change: Callable[[Any], Any]) -> np.ndarray:
    """Return a copy with some entries changed."""
    result = values.copy()
    result[where] = change(result[where])
    return result


def tensioner_friction(model, _place, size, _rng):
    return model._replace(dry=float(size['force_N']))


def tensioner_stiffness(model, _place, size, _rng):
    return model._replace(tens_k=model.tens_k * size['factor'])


def tensioner_preload(model, _place, size, _rng):
    return model._replace(preload=model.preload * size['factor'])


def tensioner_stop(model, _place, size, _rng):
    return model._replace(stop=float(size['displacement_m']))


def link_elongation(model, place, size, _rng):
    where = ends_of(model, place['link'], 'both')
    return model._replace(rest=changed(model.rest, where, lambda v: v + size['length_m']))


def chain_elongation(model, place, size, _rng):
    where = all_ends_of(model, place['side'])
    return model._replace(rest=changed(model.rest, where, lambda v: v + size['length_m']))


def link_stiffness(model, place, size, _rng):
    where = ends_of(model, place['link'], place['side'])
    return model._replace(link_k=changed(model.link_k, where, lambda v: v * size['factor']))


def roller_drag(model, place, size, _rng):
    where = ends_of(model, place['axle'], place['side'])
    return model._replace(
        extra_drag=changed(model.extra_drag, where, lambda v: v + size['force_N'])
    )


def roller_eccentricity(model, place, size, rng):
    where = ends_of(model, place['axle'], place['side'])
    phase = size.get('phase_rad', rng.uniform(0.0, 2.0 * np.pi))
    return model._replace(
        ecc=changed(model.ecc, where, lambda v: 0 * v + size['amplitude_m']),
        ecc_phase=changed(model.ecc_phase, where, lambda v: 0 * v + phase),
    )


def roller_flat(model, place, size, rng):
    where = ends_of(model, place['axle'], place['side'])
    phase = size.get('phase_rad', rng.uniform(0.0, 2.0 * np.pi))
    return model._replace(
        flat=changed(model.flat, where, lambda v: 0 * v + size['depth_m']),
        flat_phase=changed(model.flat_phase, where, lambda v: 0 * v + phase),
    )


def rolling_resistance(model, _place, size, _rng):
    return model._replace(resistance=model.resistance * size['factor'])


def friction_speed(model, _place, size, _rng):
    factor = 1.0 + size['rise'] * np.exp(-model.speed / size['speed_m_s'])
    return model._replace(resistance=model.resistance * factor)


def table_s(model: Model) -> np.ndarray:
    """Return the path coordinates (m) of the guide's tables."""
    return np.arange(model.lateral.size) * model.cell


def distance_on_loop(model: Model, s: np.ndarray, centre: float) -> np.ndarray:
    """Return signed distances (m) round the loop from ``centre``."""
    length = model.cell * model.lateral.size
    return (s - centre + 0.5 * length) % length - 0.5 * length


def bump_at(model: Model, centre: float, length_m: float) -> np.ndarray:
    """Return one smooth bump of height 1 about ``centre`` on the guide's tables."""
    away = distance_on_loop(model, table_s(model), centre)
    return np.where(
        np.abs(away) < 0.5 * length_m, 0.5 * (1.0 + np.cos(2.0 * np.pi * away / length_m)), 0.0
    )


def with_normal(model: Model, side: str, more: np.ndarray) -> Model:
    """Add a height (m) to the rails of a side or both."""
    normal = model.normal.copy()
    for a in SIDE_INDEX[side]:
        normal[a] += more
    return model._replace(
        normal=normal, normal_slope=np.stack([slope(n, model.cell) for n in normal])
    )


def guide_step(model, place, size, rng):
    length = size.get('length_m', rng.uniform(0.04, 0.08))
    bump = bump_at(model, place['s_m'], length)
    return with_normal(model, place['side'], size['height_m'] * bump)


def landing_length(model, _place, size, _rng):
    return with_landings(model, upper_m=size['delta_m'])


def with_landings(model: Model, lower_m: float = 0.0, upper_m: float = 0.0) -> Model:
    """Lay the landings longer by so much on top of what this machine has."""
    lengths = np.diff(model.seg_start)
    sheet = chosen()
    lower = lengths[0] - sheet.lower_landing_m + lower_m
    upper = lengths[4] - sheet.upper_landing_m + upper_m
    path = lay_path(sheet, float(lower), float(upper))
    return model._replace(
        seg_start=path.start,
        seg_x=path.x,
        seg_z=path.z,
        loop=float(path.start[-1]),
        seg_scale=np.diff(path.design_start) / np.diff(path.start),
    )


def in_stretch(model: Model, place: Place) -> np.ndarray:
    """Return which table cells lie in ``s_from_m`` .. ``s_to_m``, also across the seam."""
    s, a, b = table_s(model), place['s_from_m'], place['s_to_m']
    return (s >= a) & (s <= b) if a <= b else (s >= a) | (s <= b)


def guide_drag(model, place, size, _rng):
    drag = model.stretch_drag + size['force_N'] * in_stretch(model, place)
    return model._replace(stretch_drag=drag)


def drive_ripple(model, _place, size, rng):
    return model._replace(
        ripple=size['relative_amplitude'],
        ripple_per_m=size['cycles_per_pitch'] / model.pitch,
        ripple_phase=size.get('phase_rad', rng.uniform(0.0, 2.0 * np.pi)),
    )


def drive_hunting(model, _place, size, rng):
    return model._replace(
        hunting=size['relative_amplitude'],
        hunting_hz=size['frequency_hz'],
        hunting_phase=size.get('phase_rad', rng.uniform(0.0, 2.0 * np.pi)),
    )


def drive_stiffness(model, _place, size, _rng):
    return model._replace(drive_k=model.drive_k * size['factor'])


def load_distribution(model, place, size, _rng):
    half = model.mass.size // 2
    where = [a * half + int(step) for step in place['steps'] for a in (0, 1)]
    return model._replace(load=changed(model.load, where, lambda v: v * size['load_factor']))


def load_offset(model, _place, size, _rng):
    half = model.mass.size // 2
    share = np.repeat([2.0 * size['left_share'], 2.0 - 2.0 * size['left_share']], half)
    return model._replace(load=model.load * share)


def step_mass(model, place, size, _rng):
    """Put the step's extra mass on the four axle ends that carry it."""
    half = model.mass.size // 2
    axles = [(int(place['step']) + k) % half for k in (0, 1)]
    ends = [a * half + i for i in axles for a in (0, 1)]
    return model._replace(
        mass=changed(model.mass, ends, lambda v: v + 0.25 * size['delta_kg']),
        lat_mass=changed(model.lat_mass, axles, lambda v: v + 0.5 * size['delta_kg']),
    )


def truss_resonance(model, _place, size, _rng):
    omega = 2.0 * np.pi * size['frequency_hz']
    mass = size['modal_mass_kg']
    loaded = (model.load_to - model.load_from) / model.loop
    carried = model.gravity * (model.mass.sum() + loaded * model.load.sum())
    return model._replace(
        mode_x=0.0,
        mode_z=1.0,
        mode_mass=mass,
        mode_k=mass * omega**2,
        mode_c=2.0 * size['damping_ratio'] * mass * omega,
        mode_carried=carried,
    )


MACHINE_CAUSES: dict[str, Alter] = {
    'tensioner_friction': tensioner_friction,
    'tensioner_stiffness': tensioner_stiffness,
    'tensioner_preload': tensioner_preload,
    'tensioner_stop': tensioner_stop,
    'link_elongation': link_elongation,
    'chain_elongation': chain_elongation,
    'link_stiffness': link_stiffness,
    'roller_drag': roller_drag,
    'roller_eccentricity': roller_eccentricity,
    'roller_flat': roller_flat,
    'rolling_resistance': rolling_resistance,
    'friction_speed': friction_speed,
    'guide_step': guide_step,
    'landing_length': landing_length,
    'guide_drag': guide_drag,
    'drive_ripple': drive_ripple,
    'drive_hunting': drive_hunting,
    'drive_stiffness': drive_stiffness,
    'load_distribution': load_distribution,
    'load_offset': load_offset,
    'step_mass': step_mass,
    'truss_resonance': truss_resonance,
}
