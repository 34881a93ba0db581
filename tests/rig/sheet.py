"""Numbers of the prototype's data sheet, SI units, with the builder's tolerances.

Source of every value: the prototype's data sheet (``data_sheet.yaml``); those marked
"published" there are Table 1 of Cano-Moreno et al.  They are written out here once more, on
purpose: the rig shares no file with the twin.  Another machine is what `chosen` returns.
"""

from dataclasses import dataclass
from functools import cache
import json
import os
from pathlib import Path

import numpy as np

ANOTHER = 'RIG_SHEET'  # of the environment: a file that says in what another machine differs


@dataclass(frozen=True)
class Sheet:
    """The data sheet's values, before any draw of a tolerance."""

    links: int = 60  # per side, published
    pitch_m: float = 0.405  # published
    axle_mass_kg: float = 27.0  # both sides, per pitch
    link_stiffness_n_m: float = 3.0e7  # one link of one side
    link_damping_ns_m: float = 6.0e3
    section_stiffness_n: float = 7.56e7  # EA of the gauged section
    racking_stiffness_n_m: float = 2.0e5
    racking_damping_ns_m: float = 4.0e2
    roller_diameter_m: float = 0.075  # published
    contact_stiffness_n_m: float = 3.5e6  # published
    contact_damping_ns_m: float = 3.0e3
    rolling_resistance: float = 0.025  # of the normal force
    rolling_speed_m_s: float = 0.01  # of the tanh
    viscous_drag_ns_m: float = 4.0  # per roller
    rise_m: float = 4.5  # published
    inclination_rad: float = np.pi / 6.0  # 30 deg, published
    lower_landing_m: float = 0.575
    upper_landing_m: float = 0.575
    lower_transition_radius_m: float = 1.0
    upper_transition_radius_m: float = 1.5
    turnaround_radius_m: float = 0.45
    clearance_m: float = 0.5e-3  # total play
    drive_start_m: float = 7.0
    drive_length_m: float = 1.215
    drive_ramp_m: float = 0.2025  # half a pitch at each end
    drive_stiffness_n_m: float = 2.0e6  # per engaged axle end
    drive_damping_ns_m: float = 8.0e3
    carriage_mass_kg: float = 120.0
    tensioner_stiffness_n_m: float = 3.0e4  # published
    tensioner_damping_ns_m: float = 1.5e3
    load_from_m: float = 0.8
    load_to_m: float = 10.2
    load_ramp_m: float = 0.3
    lateral_stiffness_n_m: float = 2.0e4  # per axle
    lateral_damping_ns_m: float = 2.0e2
    gravity_m_s2: float = 9.81
    survey: str = ''  # file of the rails; the prototype's unless given


def chosen() -> Sheet:
    """Return the sheet of the machine that is made: the prototype's, or what the environment names."""
    return _sheet_of(os.environ.get(ANOTHER, ''))


@cache
def _sheet_of(file: str) -> Sheet:
    """Return the prototype's sheet with what a JSON file has for it; paths beside that file."""
    if not file:
        return Sheet()
    path = Path(file)
    given = json.loads(path.read_text(encoding='utf-8'))
    if 'survey' in given:
        given['survey'] = str(path.with_name(given['survey']))
    return Sheet(**given)
