"""Numbers of one machine in one experiment, as the compiled law reads them."""

from functools import lru_cache
from math import pi
from pathlib import Path
from typing import NamedTuple

import numpy as np

from escalator_twin.errors import ExperimentError
from escalator_twin.machine import Machine
from escalator_twin.physics.path import build_path
from escalator_twin.physics.survey import periodic_table, read_survey
from escalator_twin.signals import Experiment, Floats

SIDES = ('left', 'right')


class Parameters(NamedTuple):
    """All numbers of the force law; sides are rows 0 (left) and 1 (right), or one row for both.

    Lengths in m, forces in N, masses in kg. Shapes: n axles, m sides.
    """

    n_sides: int
    segments: Floats  # guide, see path.py
    length_m: float
    survey: Floats  # (m, n_grid, 2): normal deviation and its slope
    lateral: Floats  # (1, n_grid, 2): lateral line and its slope
    pitch_m: float
    link_length: Floats  # (m, n)
    link_stiffness: Floats  # (m, n)
    link_damping: Floats  # (m, n)
    end_mass: Floats  # (m, n) lumped at an axle's end
    racking_stiffness: float
    racking_damping: float
    contact_stiffness: float
    contact_damping: float
    half_clearance: float
    rolling_resistance: Floats  # (m, n) drag over normal force
    friction_rise: float  # law of speed: times 1 + rise exp(-v / friction_speed)
    friction_speed: float
    creep_speed: float
    viscous_drag: float
    roller_drag: Floats  # (m, n) dry, N
    roller_radius: float
    eccentricity: Floats  # (m, n, 2): amplitude, phase rad
    flat: Floats  # (m, n, 2): depth, phase rad
    tread_slip: Floats  # (m, n) share by which a roller turns more than its way over its radius
    guide_drag: Floats  # (k, 3): from, to, N per roller
    drive_start: float
    drive_end: float
    drive_ramp: float
    drive_stiffness: float
    drive_damping: float
    dog_spacing: float  # along the path
    ripple: Floats  # (k, 3): relative amplitude, cycles per pitch, phase rad
    hunting: Floats  # (k, 3): relative amplitude, Hz, phase rad
    lateness: Floats  # (j,) of the clock that hunting keeps behind that of the run, s; see `hunting_time`
    lateness_step: float  # s
    speed: float  # of the rack, signed, m/s
    carriage_mass: float
    carriage_stiffness: float
    carriage_damping: float
    carriage_friction: float
    carriage_stop: float  # displacement at which the stop is met; inf without
    stop_stiffness: float
    stop_damping: float
    preload: float
    load: Floats  # (m, n) weight of each step on that side, N
    load_from: float
    load_to: float
    load_ramp: float
    lateral_stiffness: float
    lateral_damping: float
    frame: Floats  # modal mass, stiffness, damping of the frame's bounce; mass 0: rigid
    gravity: float


def make_parameters(machine: Machine, experiment: Experiment, planar: bool = False) -> Parameters:
    """Lay out a machine without deviations, in an experiment, for the force law.

    Parameters
    ----------
    machine : Machine
        Its deviations are not looked at.
    experiment : Experiment
        ``set_speed_m_s`` is taken as the rack's real speed.
    planar : bool
        Lump both sides into one: half the work, no difference between left and right.

    Raises
    ------
    ExperimentError
        Where a list of loads has another length than the chain has steps.
    """
    chain, roller, guide = machine.chain, machine.roller, machine.guide
    n, m = chain.n_links, 1 if planar else 2
    both = 2.0 / m  # how many sides a row stands for
    path = build_path(guide)
    ones = np.ones((m, n))
    survey, lateral = _survey(machine, path.length_m)
    loads = np.array(experiment.load_per_step_kg)
    if len(loads) not in (1, n):
        raise ExperimentError(f'load: expected 1 or {n} values, found {len(loads)}')
    weight = np.broadcast_to(loads * machine.gravity_m_s2 / m, (n,))
    drive = machine.drive
    start, length, spacing = drive.start_m, drive.length_m, chain.pitch_m
    if drive.kind == 'wheel':
        start, length = path.passenger_m, pi * guide.turnaround_radius_m
        spacing = 2.0 * length / drive.seats
    return Parameters(
        n_sides=m,
        segments=path.segments,
        length_m=path.length_m,
        survey=np.repeat(survey[None], m, axis=0),
        lateral=lateral[None],
        pitch_m=chain.pitch_m,
        link_length=ones * chain.pitch_m,
        link_stiffness=ones * chain.link_stiffness_n_m * both,
        link_damping=ones * chain.link_damping_n_s_m * both,
        end_mass=ones * chain.mass_per_pitch_kg / m,
        racking_stiffness=chain.racking_stiffness_n_m,
        racking_damping=chain.racking_damping_n_s_m,
        contact_stiffness=roller.contact_stiffness_n_m * both,
        contact_damping=roller.contact_damping_n_s_m * both,
        half_clearance=guide.channel_clearance_m / 2.0,
        rolling_resistance=ones * roller.rolling_resistance,
        friction_rise=0.0,
        friction_speed=1.0,
        creep_speed=roller.creep_speed_m_s,
        viscous_drag=roller.viscous_drag_n_s_m * both,
        roller_drag=np.zeros((m, n)),
        roller_radius=roller.diameter_m / 2.0,
        eccentricity=np.zeros((m, n, 2)),
        flat=np.zeros((m, n, 2)),
        tread_slip=np.zeros((m, n)),
        guide_drag=np.zeros((0, 3)),
        drive_start=start,
        drive_end=start + length,
        drive_ramp=drive.ramp_m,
        drive_stiffness=drive.stiffness_n_m * both,
        drive_damping=drive.damping_n_s_m * both,
        dog_spacing=spacing,
        ripple=np.zeros((0, 3)),
        hunting=np.zeros((0, 3)),
        lateness=np.zeros(1),
        lateness_step=1.0,
        speed=float(experiment.direction * experiment.set_speed_m_s),
        carriage_mass=machine.tensioner.mass_kg,
        carriage_stiffness=machine.tensioner.stiffness_n_m,
        carriage_damping=machine.tensioner.damping_n_s_m,
        carriage_friction=machine.tensioner.dry_friction_n,
        carriage_stop=np.inf,
        stop_stiffness=0.0,
        stop_damping=0.0,
        preload=float(experiment.preload_n),
        load=np.repeat(weight[None], m, axis=0),
        load_from=machine.load.from_m,
        load_to=machine.load.to_m,
        load_ramp=machine.load.ramp_m,
        lateral_stiffness=machine.lateral.stiffness_n_m,
        lateral_damping=machine.lateral.damping_n_s_m,
        frame=np.zeros(3),
        gravity=machine.gravity_m_s2,
    )


def has_like_sides(p: Parameters) -> bool:
    """Tell whether nothing tells the left side from the right."""
    sided = (
        p.survey, p.link_length, p.link_stiffness, p.link_damping, p.end_mass,
        p.rolling_resistance, p.roller_drag, p.eccentricity, p.flat, p.tread_slip, p.load,
    )  # fmt: skip
    return all(np.array_equal(rows[0], rows[-1]) for rows in sided)


def _survey(machine: Machine, length_m: float) -> tuple[Floats, Floats]:
    """Return the periodic tables of normal and lateral deviation; zeros without a survey."""
    name = machine.guide.survey_file
    if name is None:
        return np.zeros((4, 2)), np.zeros((4, 2))
    file = (machine.source.parent if machine.source else Path()) / name
    written = file.stat().st_mtime_ns if file.exists() else 0
    return _tables(file, written, length_m, machine.guide.survey_error_m)


@lru_cache(maxsize=8)
def _tables(file: Path, _: int, length_m: float, error_m: float) -> tuple[Floats, Floats]:
    """Return the tables of a survey file as it was written at some time."""
    s, normal, lateral = read_survey(file)
    tables = (
        periodic_table(s, normal, length_m, error_m),
        periodic_table(s, lateral, length_m, error_m),
    )
    for table in tables:
        table.setflags(write=False)
    return tables
