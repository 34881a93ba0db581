"""The roller-centre path of an escalator's guide: lines and arcs, closed, analytic."""

from dataclasses import dataclass
from math import cos, pi, radians, sin, tan

import numpy as np

from escalator_twin.errors import MachineError
from escalator_twin.machine import Guide
from escalator_twin.physics.compiled import compiled, inlined
from escalator_twin.signals import Floats

# Columns of a segment row. Lines and arcs share them; an arc's reference direction is the unit
# vector from its centre to its middle, so that no angle of a half turn meets the cut of atan2.
# SCALE is path coordinate over length: 1, but on a landing that was laid longer than designed.
# FIXED and GROWS: the lower, the upper end of a segment goes with the carriage.
KIND, X, Z, CX, CZ, HALF, RADIUS, TURN, START, LENGTH, CARRIAGE, FIXED, SCALE, GROWS = range(14)
LINE, ARC = 0.0, 1.0


@dataclass(frozen=True)
class GuidePath:
    """The closed path as rows of segments, in the order of increasing path coordinate.

    Attributes
    ----------
    segments : (n, 14) float64
        See the column names of this module; lengths in m.
    length_m : float
        Length of the loop with the carriage at rest, as designed.
    passenger_m : float
        Length of the passenger run, from the lower end of the lower landing, as designed.
    """

    segments: Floats
    length_m: float
    passenger_m: float


def _line(x: float, z: float, angle: float, length: float, fixed: float) -> list[float]:
    """Return a straight segment; ``fixed`` is the end that stays when the carriage moves."""
    return [LINE, x, z, cos(angle), sin(angle), 0.0, 0.0, 0.0, 0.0, length, 0.0, fixed, 1.0, 0.0]


def _arc(
    x: float, z: float, angle: float, radius: float, turn: float, sweep: float, carriage: float
) -> list[float]:
    """Return an arc that starts at (x, z) heading ``angle``; ``turn`` +1 is to the left."""
    cx, cz = x - turn * radius * sin(angle), z + turn * radius * cos(angle)
    middle = angle - turn * pi / 2 + turn * sweep / 2
    return [
        ARC, cx, cz, cos(middle), sin(middle), sweep / 2, radius, turn, 0.0,
        radius * sweep, carriage, 0.0, 1.0, 0.0,
    ]  # fmt: skip


def build_path(guide: Guide, upper_landing_extra_m: float = 0.0) -> GuidePath:
    """Build the closed path of ``guide``.

    Frame: x from the lower to the upper landing, z up, origin at the joint of lower landing and
    lower transition on the passenger run; the return run is the passenger run shifted down by
    twice the turnaround radius.

    Parameters
    ----------
    guide : Guide
        Its radii and lengths.
    upper_landing_extra_m : float
        Added to the upper landing of both runs (cause ``landing_length``). Path coordinates stay
        those of the design: the longer landing is mapped evenly on the designed one.

    Raises
    ------
    MachineError
        Where rise and radii leave no straight incline, or no landing is left.
    """
    slope = radians(guide.inclination_deg)
    lower, upper = guide.lower_transition_radius_m, guide.upper_transition_radius_m
    height = guide.rise_m - (lower + upper) * (1.0 - cos(slope))
    incline = height / sin(slope) if slope > 0.0 else guide.rise_m
    if not incline > 0.0:
        raise MachineError(
            f'guide.rise_m: {guide.rise_m} m leaves no straight incline between transitions '
            f'of {lower} and {upper} m at {guide.inclination_deg} deg'
        )
    landing_m = guide.upper_landing_m + upper_landing_extra_m
    if upper_landing_extra_m != 0.0 and not min(landing_m, guide.upper_landing_m) > 0.0:
        raise MachineError(
            f'guide.upper_landing_m: {guide.upper_landing_m} m cannot be laid '
            f'{upper_landing_extra_m} m longer'
        )
    turnaround = guide.turnaround_radius_m
    x0 = -guide.lower_landing_m
    x1, z1 = lower * sin(slope), lower * (1.0 - cos(slope))
    x2, z2 = x1 + incline * cos(slope), z1 + incline * sin(slope)
    x3, z3 = x2 + upper * sin(slope), z2 + upper * (1.0 - cos(slope))
    x4, drop = x3 + landing_m, 2.0 * turnaround
    rows = [
        _line(x0, 0.0, 0.0, guide.lower_landing_m, 1.0),
        _arc(0.0, 0.0, 0.0, lower, 1.0, slope, 0.0),
        _line(x1, z1, slope, incline, 0.0),
        _arc(x2, z2, slope, upper, -1.0, slope, 0.0),
        _line(x3, z3, 0.0, landing_m, 0.0),
        _arc(x4, z3, 0.0, turnaround, -1.0, pi, 0.0),
        _line(x4, z3 - drop, pi, landing_m, 0.0),
        _arc(x3, z3 - drop, pi, upper, 1.0, slope, 0.0),
        _line(x2, z2 - drop, pi + slope, incline, 0.0),
        _arc(x1, z1 - drop, pi + slope, lower, -1.0, slope, 0.0),
        _line(0.0, -drop, pi, guide.lower_landing_m, 0.0),
        _arc(x0, -drop, pi, turnaround, -1.0, pi, 1.0),
    ]
    for row in (rows[4], rows[6]) if upper_landing_extra_m != 0.0 else ():
        row[SCALE] = guide.upper_landing_m / landing_m
    segments = np.array([row for row in rows if row[LENGTH] > 0.0])
    designed = segments[:, LENGTH] * segments[:, SCALE]
    segments[:, START] = np.concatenate([[0.0], np.cumsum(designed[:-1])])
    segments[:, GROWS] = np.roll(segments[:, CARRIAGE], -1)
    segments.setflags(write=False)
    passenger = sum(row[LENGTH] * row[SCALE] for row in rows[:5])
    return GuidePath(segments, float(designed.sum()), passenger)


@compiled
def locate(
    segments: Floats, k: int, x: float, z: float, u: float, w: float
) -> tuple[float, float, float, float]:
    """Project a point on segment ``k``.

    Parameters
    ----------
    segments : (n, 14) float64
        Of the path.
    k : int
        The segment.
    x, z : float
        The point, m.
    u, w : float
        Carriage displacement (outward, towards -x) and vertical frame displacement, m.

    Returns
    -------
    local, offset, tx, tz : float
        Path length from the segment's start (its own end points may be exceeded), normal offset
        to the left of travel, m; unit tangent.
    """
    z = z - w
    if segments[k, KIND] == LINE:
        dx, dz = x - segments[k, X], z - segments[k, Z]
        tx, tz = segments[k, CX], segments[k, CZ]
        return dx * tx + dz * tz, dz * tx - dx * tz, tx, tz
    rx, rz = x + segments[k, CARRIAGE] * u - segments[k, X], z - segments[k, Z]
    radius = np.sqrt(rx * rx + rz * rz)
    turn = segments[k, TURN]
    ax, az = segments[k, CX], segments[k, CZ]
    angle = turn * np.arctan2(ax * rz - az * rx, ax * rx + az * rz)
    inverse = turn / radius
    return (
        (angle + segments[k, HALF]) * segments[k, RADIUS],
        turn * (segments[k, RADIUS] - radius),
        -rz * inverse,
        rx * inverse,
    )


@compiled
def segment_at(segments: Floats, k: int, x: float, z: float, u: float, w: float) -> int:
    """Return the segment that a point projects on, walking from ``k``; the path is smooth."""
    n = len(segments)
    for _ in range(n + 1):
        local, _, _, _ = locate(segments, k, x, z, u, w)
        if local < segments[k, FIXED] * -u:
            k = k - 1 if k > 0 else n - 1
        elif local >= segments[k, LENGTH] + segments[k, GROWS] * u:
            k = k + 1 if k < n - 1 else 0
        else:
            break
    return k


@inlined
def find_segment(
    segments: Floats, hint: int, x: float, z: float, u: float, w: float
) -> tuple[int, float, float, float, float]:
    """Project a point on the path, looking first at segment ``hint``.

    Returns
    -------
    k : int
        The segment.
    local, offset, tx, tz : float
        As from ``locate``.
    """
    k = hint
    local, offset, tx, tz = locate(segments, k, x, z, u, w)
    # the landings that end at the carriage grow with it
    if local < segments[k, FIXED] * -u or local >= segments[k, LENGTH] + segments[k, GROWS] * u:
        k = segment_at(segments, k, x, z, u, w)
        local, offset, tx, tz = locate(segments, k, x, z, u, w)
    return k, local, offset, tx, tz


@compiled
def point_at(
    segments: Floats, length: float, s: float, u: float
) -> tuple[float, float, float, float]:
    """Return (x, z, tx, tz) of the path at coordinate ``s`` with the carriage at ``u``.

    The lower landings are stretched evenly, so that every coordinate of the loop exists.
    """
    s = s % length
    n = len(segments)
    k = n - 1
    for i in range(n):
        if s < segments[i, START] + segments[i, LENGTH] * segments[i, SCALE]:
            k = i
            break
    row = segments[k]
    local = (s - row[START]) / row[SCALE]
    if row[KIND] == LINE:
        if row[FIXED] == 1.0:
            local = row[LENGTH] - (row[LENGTH] - local) * (1.0 + u / row[LENGTH])
        elif segments[(k + 1) % n, CARRIAGE] == 1.0:
            local *= 1.0 + u / row[LENGTH]
        return row[X] + local * row[CX], row[Z] + local * row[CZ], row[CX], row[CZ]
    angle = row[TURN] * (local / row[RADIUS] - row[HALF])
    ux = row[CX] * np.cos(angle) - row[CZ] * np.sin(angle)
    uz = row[CX] * np.sin(angle) + row[CZ] * np.cos(angle)
    x = row[X] + row[RADIUS] * ux - row[CARRIAGE] * u
    return x, row[Z] + row[RADIUS] * uz, -row[TURN] * uz, row[TURN] * ux


def incline_limits(guide: Guide) -> tuple[float, float]:
    """Return where the straight incline of the passenger run begins and ends, m."""
    slope = radians(guide.inclination_deg)
    start = guide.lower_landing_m + guide.lower_transition_radius_m * slope
    radii = guide.lower_transition_radius_m + guide.upper_transition_radius_m
    if slope == 0.0:
        return start, start + guide.rise_m
    return start, start + guide.rise_m / sin(slope) - radii * tan(slope / 2.0)
