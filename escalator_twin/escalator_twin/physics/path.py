"""The roller-centre path of an escalator's guide: lines and arcs, closed, analytic."""

from dataclasses import dataclass
from math import cos, pi, radians, sin, tan

import numpy as np

from escalator_twin.errors import MachineError
from escalator_twin.machine import Guide
from escalator_twin.physics.compiled import compiled, inlined
from escalator_twin.physics.profile import (
    circular,
    compensated,
    Curve,
    end_of,
    tangent_length,
)
from escalator_twin.signals import Floats

# Columns of a segment row. Lines and arcs share them; an arc's reference direction is the unit
# vector from its centre to its middle, so that no angle of a half turn meets the cut of atan2.
# SCALE is path coordinate over length: 1, but on a landing that was laid longer than designed.
# FIXED and GROWS: the lower, the upper end of a segment goes with the carriage.
KIND, X, Z, CX, CZ, HALF, RADIUS, TURN, START, LENGTH, CARRIAGE, FIXED, SCALE, GROWS = range(14)
LINE, ARC = 0.0, 1.0
STRAIGHT = 1e-7  # rad, least turn of an arc: below it, the radius would lose the place


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


def _line(
    x: float, z: float, angle: float, length: float, fixed: float = 0.0, scale: float = 1.0
) -> list[list[float]]:
    """Return a straight piece; ``fixed`` is 1 where its end stays when the carriage moves."""
    if length <= 0.0:
        return []
    row = [LINE, x, z, cos(angle), sin(angle), 0.0, 0.0, 0.0, 0.0, length, 0.0, fixed, scale, 0.0]
    return [row]


def _bend(
    x: float, z: float, angle: float, curve: Curve, turn: float, carriage: float = 0.0
) -> list[list[float]]:
    """Return the arcs of a curve from (x, z), heading ``angle``; ``turn`` +1 is to the left."""
    rows = []
    for length, sweep in curve:
        if length <= 0.0:
            continue
        side, bent = (turn if sweep >= 0.0 else -turn), max(abs(sweep), STRAIGHT)
        radius = length / bent
        cx, cz = x - side * radius * sin(angle), z + side * radius * cos(angle)
        middle = angle - side * pi / 2 + side * bent / 2
        rows.append([
            ARC, cx, cz, cos(middle), sin(middle), bent / 2, radius, side, 0.0, length, carriage,
            0.0, 1.0, 0.0,
        ])  # fmt: skip
        angle += side * bent
        x, z = cx + side * radius * sin(angle), cz - side * radius * cos(angle)
    return rows


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
    lower, upper, turnaround = _curves(guide, slope)
    (width, z1), (dx, dz), (_, drop) = end_of(lower), end_of(upper), end_of(turnaround)
    height = guide.rise_m - z1 - dz
    incline = height / sin(slope) if slope > 0.0 else guide.rise_m
    # the corners of the straights stay where circles would have them
    x_a = guide.lower_transition_radius_m * tan(slope / 2.0) - tangent_length(lower)
    spare = guide.upper_transition_radius_m * tan(slope / 2.0) - tangent_length(upper)
    below, designed_m = guide.lower_landing_m + x_a, guide.upper_landing_m + spare
    above = designed_m + upper_landing_extra_m
    _check_straights(guide, incline, below, designed_m, above)
    x0, x1 = -guide.lower_landing_m, x_a + width
    x2, z2 = x1 + incline * cos(slope), z1 + incline * sin(slope)
    x3, z3 = x2 + dx, z2 + dz
    x4 = x3 + above
    scale = designed_m / above if upper_landing_extra_m != 0.0 else 1.0
    passenger = [
        *_line(x0, 0.0, 0.0, below, fixed=1.0),
        *_bend(x_a, 0.0, 0.0, lower, 1.0),
        *_line(x1, z1, slope, incline),
        *_bend(x2, z2, slope, upper, -1.0),
        *_line(x3, z3, 0.0, above, scale=scale),
    ]
    rows = [
        *passenger,
        *_bend(x4, z3, 0.0, turnaround, -1.0),
        *_line(x4, z3 - drop, pi, above, scale=scale),
        *_bend(x3, z3 - drop, pi, upper, 1.0),
        *_line(x2, z2 - drop, pi + slope, incline),
        *_bend(x1, z1 - drop, pi + slope, lower, -1.0),
        *_line(x_a, -drop, pi, below),
        *_bend(x0, -drop, pi, turnaround, -1.0, carriage=1.0),
    ]
    segments = np.array(rows)
    designed = segments[:, LENGTH] * segments[:, SCALE]
    segments[:, START] = np.concatenate([[0.0], np.cumsum(designed[:-1])])
    carriage = segments[:, CARRIAGE]
    segments[:, GROWS] = np.roll(carriage, -1) * (1.0 - carriage)
    segments.setflags(write=False)
    return GuidePath(segments, float(designed.sum()), float(designed[: len(passenger)].sum()))


def _check_straights(
    guide: Guide, incline: float, below: float, designed: float, above: float
) -> None:
    """Raise a MachineError where curves leave no straight between them."""
    if not incline > 0.0:
        raise MachineError(
            f'guide.rise_m: {guide.rise_m} m leaves no straight incline between transitions of '
            f'{guide.lower_transition_radius_m} and {guide.upper_transition_radius_m} m at '
            f'{guide.inclination_deg} deg'
        )
    if min(below, designed) < 0.0:
        raise MachineError(
            f'guide.transition_profile: {guide.transition_profile} transitions leave landings of '
            f'{below:.4f} m below and {designed:.4f} m above'
        )
    if above != designed and not min(above, designed) > 0.0:
        raise MachineError(
            f'guide.upper_landing_m: {designed:.4f} m cannot be laid {above - designed} m longer'
        )


def _curves(guide: Guide, slope: float) -> tuple[Curve, Curve, Curve]:
    """Return the shapes of lower transition, upper transition and turnarounds."""

    def shape(profile: str, turn: float, radius_m: float) -> Curve:
        if profile == 'compensated' and turn > 0.0 and guide.profile_pitch_m is not None:
            return compensated(turn, radius_m, guide.profile_pitch_m)
        return circular(turn, radius_m)

    return (
        shape(guide.transition_profile, slope, guide.lower_transition_radius_m),
        shape(guide.transition_profile, slope, guide.upper_transition_radius_m),
        shape(guide.turnaround_profile, pi, guide.turnaround_radius_m),
    )


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
