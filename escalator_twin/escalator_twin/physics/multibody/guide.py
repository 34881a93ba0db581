"""The guides of a machine as segments: chain rollers', trailing rollers', handrail's."""

from dataclasses import dataclass
from math import asin, atan2, cos, hypot, inf, pi, radians, sin, sqrt

import numpy as np
from scipy.optimize import brentq

from escalator_twin.errors import MachineError
from escalator_twin.machine.multibody import Handrail, Material, MultibodyMachine, TwoRunGuide
from escalator_twin.physics.multibody import segments as seg
from escalator_twin.physics.multibody.law import combined_curvature, hysteresis, nominal_stiffness
from escalator_twin.physics.multibody.segments import Faces, Pen
from escalator_twin.signals import Floats, read_only

SIDES = 2.0  # how many real contacts one of the planar model stands for
CARRIAGE = 0.0  # part: the lower gear
GEAR, PULLEY = 0.0, 1.0  # rotors
LEAST_FALL = 1e-9  # rad: less is rounding
LEAST_CURVATURE = 1e-3  # 1/m: a hollow face closer to its roller touches along a line

STEP_SEGMENTS = (
    'lower landing', 'lower transition', 'incline', 'upper transition', 'upper landing',
    'upper gear', 'return incline', 'return transition', 'lower gear',
)  # fmt: skip
HANDRAIL_SEGMENTS = (
    'lower landing', 'lower transition', 'incline', 'upper transition', 'upper landing',
    'upper newel', 'deflector', 'driving pulley', 'belt tensioner', 'return incline',
    'lower tensioner', 'lower newel',
)  # fmt: skip


@dataclass(frozen=True)
class Track:
    """A closed path as segments.

    Attributes
    ----------
    rows : (n, 26) float64
        See `segments`.
    names : tuple of str
    length_m : float
    passenger_m : float
        Of the passenger run.
    """

    rows: Floats
    names: tuple[str, ...]
    length_m: float
    passenger_m: float


@dataclass(frozen=True)
class ReturnRun:
    """The return run between the gears: angle of its fall (rad), length of its straight part."""

    fall: float
    straight_m: float


def gear_distance(guide: TwoRunGuide) -> tuple[float, float]:
    """Return by how much the upper gear is to the right of the lower one, and above it, m."""
    slope = radians(guide.inclination_deg)
    bends = guide.lower_transition_radius_m + guide.upper_transition_radius_m
    level = guide.lower_landing_m + guide.upper_landing_m + guide.tread_length_m
    level += bends * sin(slope) + incline_length(guide) * cos(slope)
    return level, guide.rise_m


def incline_length(guide: TwoRunGuide) -> float:
    """Return the straight part of the incline, m."""
    slope = radians(guide.inclination_deg)
    if slope == 0.0:
        return 0.0
    bends = guide.lower_transition_radius_m + guide.upper_transition_radius_m
    length = (guide.rise_m - bends * (1.0 - cos(slope))) / sin(slope)
    if length <= 0.0:
        raise MachineError(
            f'guide.rise_m: transitions of {bends} m radius in all leave no incline in a rise '
            f'of {guide.rise_m} m'
        )
    return length


def return_run(guide: TwoRunGuide) -> ReturnRun:
    """Return the common tangent of the upper gear and of the arc above the lower gear.

    Both are turned round in the same sense, so that it is parallel to the line of their centres
    where their radii are the same, and leans by their difference over the distance if not.
    """
    x, z = gear_distance(guide)
    radius, bend = guide.turnaround_radius_m, guide.return_transition_radius_m
    # centre of the arc: above the lower gear's lowest point
    dx, dz = x, z - (bend - radius)
    distance = hypot(dx, dz)
    fall = atan2(dz, dx) + asin((bend - radius) / distance)
    return ReturnRun(fall if fall > LEAST_FALL else 0.0, sqrt(distance**2 - (bend - radius) ** 2))


def _face(row: Floats, material: Material, point_m: float, surface: tuple[float, float]) -> None:
    """Fill a segment's contact numbers; ``surface`` holds R_2 of the lower and the upper face."""
    for column, radius in zip((seg.STIFF_LOW, seg.STIFF_HIGH), surface, strict=True):
        curvature = max(combined_curvature(point_m, radius), LEAST_CURVATURE)
        row[column] = SIDES * nominal_stiffness(material.elastic_modulus_pa, curvature)
    row[seg.LOSS] = hysteresis(material.restitution)
    row[seg.NORMAL_SPEED] = material.normal_speed_m_s
    row[seg.FRICTION], row[seg.SLIDING_SPEED] = material.friction, material.sliding_speed_m_s


def _bent(row: Floats, material: Material, point_m: float) -> None:
    """Fill contact numbers of a rail: its faces lie one roller radius to either side."""
    turn, radius = row[seg.TURN], row[seg.RADIUS]
    if turn == 0.0:
        surface = inf, inf
    else:
        # the lower face of a right turn bulges towards the roller, that of a left turn is hollow
        surface = -turn * (radius + turn * point_m), turn * (radius - turn * point_m)
    _face(row, material, point_m, surface)
    row[seg.LEVER] = point_m


def _step_track(machine: MultibodyMachine, behind_m: float) -> Track:
    """Return the track of rollers; ``behind_m`` shifts the passenger run back."""
    guide = machine.guide
    slope, play = radians(guide.inclination_deg), guide.channel_clearance_m
    back = return_run(guide)
    carrying = Faces(0.0, 0.0, play)
    pen = Pen(0.0, guide.turnaround_radius_m, 0.0)
    pen.line(guide.lower_landing_m - behind_m, carrying)
    pen.arc(guide.lower_transition_radius_m, slope, carrying)
    pen.line(incline_length(guide) + (guide.tread_length_m if slope == 0.0 else 0.0), carrying)
    pen.arc(guide.upper_transition_radius_m, -slope, carrying)
    pen.line(guide.upper_landing_m + behind_m, carrying)
    passenger = pen.way
    upper = pen.arc(guide.turnaround_radius_m, -(pi - back.fall), carrying)
    pen.line(back.straight_m, Faces(0.0, -play, play))
    # the chain's pull presses inwards beside gears and in hollow bends, weight outwards between
    pen.arc(guide.return_transition_radius_m, -back.fall, Faces(-play, 0.0, play))
    lower = pen.arc(guide.turnaround_radius_m, -pi, carrying)
    lower[seg.PART], lower[seg.TAIL] = CARRIAGE, 1.0
    tread = machine.roller.diameter_m / 2.0
    for row in pen.rows:
        _bent(row, machine.contact.tread, tread)
    if behind_m == 0.0:
        for row in (upper, lower):
            _rim(row, machine)
        upper[seg.ROTOR] = GEAR
        _seats(upper, machine)
    return Track(read_only(np.array(pen.rows)), STEP_SEGMENTS, pen.way, passenger)


def _rim(row: Floats, machine: MultibodyMachine) -> None:
    """Make an arc the rim of a gear, on which the chain's rollers sit from outside alone."""
    tread = machine.roller.diameter_m / 2.0
    row[[seg.LOW, seg.LOW_END, seg.WIDTH]] = 0.0, 0.0, inf
    rim = row[seg.RADIUS] - tread
    _face(row, machine.contact.gear, tread, (rim, rim))


def _seats(row: Floats, machine: MultibodyMachine) -> None:
    """Give the upper gear its seats; a flank is taken as flat."""
    drive, gear = machine.drive, machine.contact.gear
    curvature = combined_curvature(machine.roller.diameter_m / 2.0)
    row[seg.SEAT_ARC] = 2.0 * pi * row[seg.RADIUS] / drive.seats
    row[seg.SEAT_PLAY] = drive.flank_play_m
    row[seg.SEAT_STIFF] = SIDES * nominal_stiffness(gear.elastic_modulus_pa, curvature)
    row[seg.SEAT_RAMP] = drive.ramp_m


def chain_track(machine: MultibodyMachine) -> Track:
    """Return the closed track of the chain rollers, from the lower end of the lower landing."""
    return _step_track(machine, 0.0)


def trailing_track(machine: MultibodyMachine) -> Track:
    """Return the closed track of the trailing rollers."""
    return _step_track(machine, machine.step.wheelbase_m)


def _draw_handrail(
    machine: MultibodyMachine, handrail: Handrail, fall: float, back_m: float
) -> Pen:
    """Draw the handrail's centre line with a return incline of an angle and a length."""
    guide, slope = handrail.guide, radians(machine.guide.inclination_deg)
    bends = guide.lower_transition_radius_m + guide.upper_transition_radius_m
    rise, incline = machine.guide.rise_m, machine.guide.tread_length_m
    if slope > 0.0:
        incline = (rise - bends * (1.0 - cos(slope))) / sin(slope)
    both = Faces(-guide.clearance_m / 2.0, -guide.clearance_m / 2.0, guide.clearance_m)
    steeper, wrap = radians(guide.steeper_deg), radians(guide.pulley_wrap_deg)
    pen = Pen(0.0, 2.0 * guide.newel_radius_m, 0.0)
    pen.line(guide.lower_landing_m, both)
    pen.arc(guide.lower_transition_radius_m, slope, both)
    pen.line(incline, both)
    pen.arc(guide.upper_transition_radius_m, -slope, both)
    pen.line(guide.upper_landing_m, both)
    pen.arc(guide.newel_radius_m, -pi, both)
    pen.arc(guide.deflector_radius_m, fall + steeper, both)
    pen.arc(handrail.pulley_radius_m, -wrap, both)
    pen.arc(guide.belt_tensioner_radius_m, wrap - steeper, both)
    pen.line(back_m, both)
    pen.arc(guide.lower_tensioner_radius_m, -fall, both)
    pen.arc(guide.newel_radius_m, -pi, both)
    return pen


def handrail_track(machine: MultibodyMachine, handrail: Handrail) -> Track:
    """Return the closed centre line of the handrail, from its lower landing on.

    Angle and length of the return incline are those that close the loop.
    """
    guide = handrail.guide
    rise, end = machine.guide.rise_m, 2.0 * guide.newel_radius_m

    def open_by(fall: float) -> tuple[float, float]:
        pen = _draw_handrail(machine, handrail, fall, 0.0)
        return pen.x, pen.z - end

    def across(fall: float) -> float:
        x, z = open_by(fall)
        return x * sin(fall) - z * cos(fall)

    # a level walk's drive brings the handrail back to its height by itself
    fall = 0.0 if rise == 0.0 else float(brentq(across, 0.0, radians(60.0), xtol=1e-14))
    x, z = open_by(fall)
    if abs(across(fall)) > 1e-9 or x <= 0.0:
        raise MachineError(
            f'handrail.guide: the loop does not close: it ends {x:.3f} m, {z:.3f} m off'
        )
    pen = _draw_handrail(machine, handrail, fall, hypot(x, z))
    for row, name in zip(pen.rows, HANDRAIL_SEGMENTS, strict=True):
        material = handrail.slide
        if name in (
            'upper newel',
            'lower newel',
            'deflector',
            'belt tensioner',
            'lower tensioner',
        ):
            material = handrail.roll
        if name == 'driving pulley':
            material, row[seg.ROTOR] = handrail.pulley, PULLEY
        _bent(row, material, handrail.face_radius_m)
        row[seg.LEVER] = 0.0  # the line in its middle is what keeps its length
    passenger = float(pen.rows[5][seg.START])
    return Track(read_only(np.array(pen.rows)), HANDRAIL_SEGMENTS, pen.way, passenger)
