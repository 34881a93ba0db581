"""Rails, curves and gears as rows: straight lines and arcs with two faces, and where a point is.

A centre line with its left normal n; a point at the offset e along n touches the lower face below
``LOW`` and the upper one above ``LOW + WIDTH``. ``LOW`` runs linearly along the segment.
"""

from dataclasses import dataclass
from math import cos, inf, pi, sin

import numpy as np

from escalator_twin.physics.compiled import compiled
from escalator_twin.signals import Floats

# X, Z: start of a line, centre of an arc. UX, UZ: its direction; of an arc, from its centre to its
# middle. TURN: 0 of a line, else +1 to the left. PART: what carries it, ROTOR: what drives its
# surface, -1 for none. TAIL: the arc goes on straight at both ends as far as its part has moved.
X, Z, UX, UZ, LENGTH, TURN, RADIUS, HALF, START, PART, ROTOR, TAIL = range(12)
LOW, LOW_END, WIDTH, STIFF_LOW, STIFF_HIGH, LOSS, NORMAL_SPEED, FRICTION, SLIDING_SPEED = range(
    12, 21
)
# LEVER: from the body's centre to the touching surface. Seats (teeth) of a gear:
SEAT_ARC, SEAT_PLAY, SEAT_STIFF, SEAT_RAMP, LEVER = range(21, 26)
N_COLUMNS = 26
NONE = -1.0


@dataclass(frozen=True)
class Faces:
    """Offsets of a segment's faces from its centre line, m, at its two ends.

    Attributes
    ----------
    low, low_end : float
        Of the lower face, at start and end.
    width : float
        Between the faces; infinite where there is no upper one.
    """

    low: float = 0.0
    low_end: float = 0.0
    width: float = inf


class Pen:
    """Draws a path of lines and arcs, each beginning where the last ended.

    Parameters
    ----------
    x, z : float
        Where it begins, m.
    heading : float
        Rad from x to z.
    """

    def __init__(self, x: float, z: float, heading: float) -> None:
        self.x, self.z, self.heading, self.way = x, z, heading, 0.0
        self.rows: list[Floats] = []

    def _row(self, length: float, faces: Faces) -> Floats:
        row = np.zeros(N_COLUMNS)
        row[LENGTH], row[START] = length, self.way
        row[PART] = row[ROTOR] = NONE
        row[[LOW, LOW_END, WIDTH]] = faces.low, faces.low_end, faces.width
        self.rows.append(row)
        self.way += length
        return row

    def line(self, length: float, faces: Faces) -> Floats:
        """Draw a line; return its row."""
        row = self._row(length, faces)
        row[[X, Z]] = self.x, self.z
        row[[UX, UZ]] = cos(self.heading), sin(self.heading)
        self.x += length * cos(self.heading)
        self.z += length * sin(self.heading)
        return row

    def arc(self, radius: float, turn: float, faces: Faces) -> Floats:
        """Draw an arc by ``turn`` rad, positive to the left; return its row."""
        side = 1.0 if turn >= 0.0 else -1.0
        row = self._row(radius * abs(turn), faces)
        a = self.heading
        cx, cz = self.x - side * radius * sin(a), self.z + side * radius * cos(a)
        middle = a - side * pi / 2.0 + turn / 2.0
        row[[X, Z, UX, UZ]] = cx, cz, cos(middle), sin(middle)
        row[[TURN, RADIUS, HALF]] = side, radius, abs(turn) / 2.0
        self.heading = a + turn
        self.x = cx + side * radius * sin(self.heading)
        self.z = cz - side * radius * cos(self.heading)
        return row


@compiled
def locate(
    row: Floats, x: float, z: float, tail: float
) -> tuple[bool, float, float, float, float]:
    """Return whether a point is beside a segment, its way along it, offset, and tangent (x, z).

    Parameters
    ----------
    row : (26,) float64
    x, z : float
        In the frame of what carries the segment.
    tail : float
        By how much an arc goes on straight at either end, m.
    """
    if row[TURN] == 0.0:
        dx, dz = x - row[X], z - row[Z]
        s = dx * row[UX] + dz * row[UZ]
        return (
            -tail <= s < row[LENGTH] + tail,
            s,
            dz * row[UX] - dx * row[UZ],
            row[UX],
            row[UZ],
        )
    dx, dz = x - row[X], z - row[Z]
    turn, half, radius = row[TURN], row[HALF], row[RADIUS]
    angle = turn * np.arctan2(row[UX] * dz - row[UZ] * dx, row[UX] * dx + row[UZ] * dz)
    if -half <= angle < half:
        distance = np.sqrt(dx * dx + dz * dz)
        if distance == 0.0:
            return False, 0.0, 0.0, 1.0, 0.0
        tx, tz = -turn * dz / distance, turn * dx / distance
        return True, radius * (angle + half), turn * (radius - distance), tx, tz
    if tail <= 0.0:
        return False, radius * (angle + half), 0.0, 1.0, 0.0
    # straight beyond the nearer end
    end = half if angle > 0.0 else -half
    c, s = np.cos(turn * end), np.sin(turn * end)
    rx, rz = row[UX] * c - row[UZ] * s, row[UX] * s + row[UZ] * c
    tx, tz = -turn * rz, turn * rx
    dx, dz = dx - radius * rx, dz - radius * rz
    along = dx * tx + dz * tz
    beside = 0.0 <= along <= tail if angle > 0.0 else -tail <= along <= 0.0
    return beside, radius * (end + half) + along, dz * tx - dx * tz, tx, tz


@compiled
def place_on(rows: Floats, length: float, s: float) -> tuple[float, float, float, float]:
    """Return point (x, z) and tangent of a closed path at a path coordinate."""
    s = s % length
    k = len(rows) - 1
    while k > 0 and rows[k, START] > s:
        k -= 1
    row = rows[k]
    along = s - row[START]
    if row[TURN] == 0.0:
        return row[X] + along * row[UX], row[Z] + along * row[UZ], row[UX], row[UZ]
    angle = row[TURN] * (along / row[RADIUS] - row[HALF])
    c, d = np.cos(angle), np.sin(angle)
    rx, rz = row[UX] * c - row[UZ] * d, row[UX] * d + row[UZ] * c
    return (
        row[X] + row[RADIUS] * rx,
        row[Z] + row[RADIUS] * rz,
        -row[TURN] * rz,
        row[TURN] * rx,
    )


@compiled
def next_at(rows: Floats, length: float, s: float, chord: float) -> float:
    """Return the path coordinate ahead of ``s`` whose point is ``chord`` away from that of s."""
    x, z, _, _ = place_on(rows, length, s)
    ahead = s + chord
    for _ in range(40):
        px, pz, tx, tz = place_on(rows, length, ahead)
        dx, dz = px - x, pz - z
        distance = np.sqrt(dx * dx + dz * dz)
        change = (chord - distance) * distance / (dx * tx + dz * tz)
        ahead += change
        if abs(change) < 1e-13:
            break
    return ahead
