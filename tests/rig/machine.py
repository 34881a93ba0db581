"""One machine: the data sheet with its draws, and the record that the kernels read."""

from dataclasses import dataclass
import math
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rig.guide import lay_path, read_survey, tabulate
from rig.model import Model, READINGS
from rig.sheet import Sheet

FloatArray = NDArray[np.float64]
SURVEY = Path(__file__).with_name('rail_survey.csv')
NEVER_N = 1e12  # N, a force that is not reached


@dataclass(frozen=True)
class Case:
    """One experiment: set values and the real speed of the run."""

    speed_m_s: float
    direction: int
    load_kg: float
    preload_n: float


def survey_of(sheet: Sheet) -> Path:
    """Return the file of a machine's rails."""
    return Path(sheet.survey) if sheet.survey else SURVEY


def nominal(
    sheet: Sheet,
    case: Case,
    real_speed: float,
    smooth: bool = False,
    lower_m: float = 0.0,
    upper_m: float = 0.0,
) -> Model:
    """Return the machine of the data sheet without any draw."""
    path = lay_path(sheet, lower_m, upper_m)
    length = float(path.design_start[-1])
    survey = read_survey(survey_of(sheet))
    normal = tabulate(survey[:, 0], survey[:, 1], length, smooth)
    lateral = tabulate(survey[:, 0], survey[:, 2], length, smooth)
    cells = normal.size
    cell = length / cells
    n, ends = sheet.links, 2 * sheet.links
    return Model(
        seg_start=path.start,
        seg_x=path.x,
        seg_z=path.z,
        seg_heading=path.heading,
        seg_cos=np.cos(path.heading),
        seg_sin=np.sin(path.heading),
        seg_curvature=path.curvature,
        seg_design=path.design_start[:12].copy(),
        seg_scale=np.diff(path.design_start) / np.diff(path.start),
        loop=float(path.start[-1]),
        cell=cell,
        normal=np.stack([normal, normal]),
        normal_slope=np.stack([slope(normal, cell)] * 2),
        lateral=lateral,
        lateral_slope=slope(lateral, cell),
        half_play=np.full((2, cells), 0.5 * sheet.clearance_m),
        stretch_drag=np.zeros((2, cells)),
        support=np.ones((2, cells)),
        pitch=sheet.pitch_m,
        mass=np.full(ends, 0.5 * sheet.axle_mass_kg),
        link_k=np.full(ends, sheet.link_stiffness_n_m),
        link_c=np.full(ends, sheet.link_damping_ns_m),
        rest=np.full(ends, sheet.pitch_m),
        rest_rate=0.0,
        rack_k=sheet.racking_stiffness_n_m,
        rack_c=sheet.racking_damping_ns_m,
        bend=np.zeros(n),
        contact_k=sheet.contact_stiffness_n_m,
        contact_c=sheet.contact_damping_ns_m,
        resistance=np.full(ends, sheet.rolling_resistance),
        resistance_rate=0.0,
        roll_speed=sheet.rolling_speed_m_s,
        viscous=sheet.viscous_drag_ns_m,
        extra_drag=np.zeros(ends),
        seizing=np.zeros(ends),
        radius=0.5 * sheet.roller_diameter_m,
        ecc=np.zeros(ends),
        ecc_phase=np.zeros(ends),
        flat=np.zeros(ends),
        flat_phase=np.zeros(ends),
        flat_angle=np.deg2rad(20.0),
        drive_from=sheet.drive_start_m,
        drive_to=sheet.drive_start_m + sheet.drive_length_m,
        drive_ramp=sheet.drive_ramp_m,
        drive_k=sheet.drive_stiffness_n_m,
        drive_c=sheet.drive_damping_ns_m,
        speed=real_speed,
        direction=float(case.direction),
        wander=np.zeros(2),
        wander_step=1.0,
        ripple=0.0,
        ripple_per_m=0.0,
        ripple_phase=0.0,
        hunting=0.0,
        hunting_hz=0.0,
        hunting_phase=0.0,
        slip_force=NEVER_N,
        rack_dogs=1,
        bad_dog=0,
        bad_dog_m=0.0,
        carriage_mass=sheet.carriage_mass_kg,
        tens_k=sheet.tensioner_stiffness_n_m,
        tens_c=sheet.tensioner_damping_ns_m,
        tens_k3=0.0,
        preload=case.preload_n,
        preload_rate=0.0,
        dry=0.0,
        dry_speed=5e-4,
        stop=1.0,
        stop_k=2e7,
        stop_c=2e4,
        load=np.full(ends, 0.5 * case.load_kg),
        load_from=sheet.load_from_m,
        load_to=sheet.load_to_m,
        load_ramp=sheet.load_ramp_m,
        swing=0.0,
        swing_hz=1.0,
        boarding_s=math.inf,
        boarding=0.0,
        lat_k=sheet.lateral_stiffness_n_m,
        lat_c=sheet.lateral_damping_ns_m,
        lat_mass=np.full(n, sheet.axle_mass_kg),
        gravity=sheet.gravity_m_s2,
        mode_x=0.0,
        mode_z=1.0,
        mode_mass=0.0,
        mode_k=0.0,
        mode_c=0.0,
        mode_carried=0.0,
        reading=np.ones(len(READINGS)),
        blow_force=0.0,
        blow_period=1.0,
        blow_width=0.0,
        shake_force=0.0,
        shake_hz=1.0,
        rub_force=0.0,
        rub_from=0.0,
        rub_to=0.0,
        rub_period=1.0,
        rub_on=0.0,
    )


def slope(values: FloatArray, cell: float) -> FloatArray:
    """Return the periodic central difference of a table."""
    return (np.roll(values, -1) - np.roll(values, 1)) / (2.0 * cell)
