"""One pitch of travel of a machine whose links are all alike stands for all of its travel.

After a pitch every part has taken the place of the one ahead, and the machine is the same again
(guide, tensioner and drive stand still or repeat by the pitch). What link k sees in pitch j, link
k + j sees in the first pitch. Measured on the prototype: five pitches after setting off, forces of
a loop repeat to 0.02 N.
"""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from escalator_twin.machine import Sensor
from escalator_twin.physics import run
from escalator_twin.physics.compiled import compiled
from escalator_twin.physics.parameters import Parameters
from escalator_twin.physics.rollout import probe_of, Simulation, Trace
from escalator_twin.signals import Floats

Turn = TypeVar('Turn', int, np.ndarray)

# Run before the pitch that is kept, beyond what every start settles, and a pitch at least. Forces of a loop
# are then as near to those after nine pitches as any two runs are, whose rollers rattle: 0.2 to 0.6 N
# (five settings from 0.23 to 0.5 m/s; 0.8 s would leave 1 N at 0.5 m/s).
LEAD_S = 1.6
# The same where a running machine goes on over another rail, whose carriage swings that out: at 0.5 m/s
# forces were off by 2 N after 3.3 s, by 0.5 N after 4.8 s, 150 N being what the rail does.
GOES_ON_S = 4.0
SAME = (
    0.02  # of the carriage's motion: two pitches that differ by more are not one another's image
)


def is_uniform(p: Parameters) -> bool:
    """Tell whether all links, axles and steps are alike and the drive repeats by the pitch."""
    alike = (
        p.link_length, p.link_stiffness, p.link_damping, p.end_mass, p.rolling_resistance,
        p.roller_drag, p.eccentricity, p.flat, p.load,
    )  # fmt: skip
    # a tread that is not round is another one after each pitch, even where all are alike
    round_ = not np.any(p.eccentricity[..., 0]) and not np.any(p.flat[..., 0])
    steady = not len(p.ripple) + len(p.hunting)
    return bool(round_ and steady and all(np.all(a == a[:, :1]) for a in alike))


@dataclass(frozen=True)
class Pitch:
    """One pitch of a uniform machine, recorded with all its links.

    Attributes
    ----------
    rows : (n, 1 + 6 k) float64
        Carriage; tensions of all k links left and right; accelerations of all steps along x, y, z;
        places of all axles. At an even rate, beginning ``margin_s`` before the pitch.
    rate_hz : float
    margin_s : float
    period_s : float
        In which a pitch passes.
    direction : int
        Of travel.
    length_m : float
        Of the loop.
    rack_m : float
        Travel of the rack at the pitch's beginning, a dog counted as a pitch.
    speed_m_s : float
        Of the chain, signed.
    """

    rows: Floats
    rate_hz: float
    margin_s: float
    period_s: float
    direction: int
    length_m: float
    rack_m: float
    speed_m_s: float

    @property
    def n_links(self) -> int:
        """How many links one side has."""
        return (self.rows.shape[1] - 1) // 6

    def column(self, probe: np.ndarray, at: Turn) -> Turn:
        """Return the column of what a probe sees in a pitch, or in each of several."""
        kind, index, side = (int(value) for value in probe)
        n = self.n_links
        if kind == run.CARRIAGE:
            return 0 * at
        place = (index + self.direction * at) % n
        if kind == run.LINK_FORCE:
            return 1 + side * n + place
        order = (run.ACCEL_X, run.ACCEL_Y, run.ACCEL_Z, run.PLACE)
        return 1 + (2 + order.index(kind)) * n + place

    def places(self) -> tuple[Floats, Floats]:
        """Return times from the pitch's beginning, and axle 0's unwrapped places, over a loop."""
        first = round(self.margin_s * self.rate_hz)
        count = int(self.period_s * self.rate_hz)
        inside = np.arange(first, first + count)
        probe = np.array([run.PLACE, 0, 0])
        columns = [self.column(probe, j) for j in range(self.n_links + 1)]
        where = self.rows[inside][:, columns].T.ravel()
        times = (inside / self.rate_hz - self.margin_s) + self.period_s * np.arange(
            self.n_links + 1
        )[:, None]
        return times.ravel(), np.unwrap(where, period=self.length_m)

    def at(self, times_s: Floats, probes: np.ndarray) -> Floats:
        """Return what probes see at times from the pitch's beginning, (n, p)."""
        turn = np.floor(times_s / self.period_s).astype(int)
        where = (times_s - turn * self.period_s + self.margin_s) * self.rate_hz
        first, weights = _lagrange(where, len(self.rows))
        columns = np.stack([self.column(probe, turn) for probe in probes], axis=1)
        seen = np.empty(columns.shape)
        weigh_rows(self.rows, first, np.stack(weights), columns, seen)
        for k in np.flatnonzero(probes[:, 0] == run.PLACE):
            # beside the first, wherever the loop begins anew
            values = [self.rows[first + i, columns[:, k]] for i in range(len(weights))]
            half = 0.5 * self.length_m
            ahead = [(v - values[0] + half) % self.length_m - half for v in values]
            seen[:, k] = values[0] + sum(w * a for w, a in zip(weights, ahead, strict=True))
        return seen


@compiled
def weigh_rows(
    rows: Floats, first: NDArray[np.int64], weights: Floats, columns: NDArray[np.int64],
    out: Floats,
) -> None:  # fmt: skip
    """Write sums of rows in succession from ``first`` (n,), by weights (r, n), of columns (n, p)."""
    for i in range(out.shape[0]):
        for k in range(out.shape[1]):
            total = 0.0
            for j in range(weights.shape[0]):
                total += weights[j, i] * rows[first[i] + j, columns[i, k]]
            out[i, k] = total


def between(rows: np.ndarray, where: Floats) -> np.ndarray:
    """Return columns (n, k) at fractional rows, by Lagrange's polynomial through four rows.

    At ten samples a period it is off by 0.4 %, at twenty by 0.02 %.
    """
    first, weights = _lagrange(where, len(rows))
    weights = tuple(w.astype(rows.dtype) for w in weights)
    total = weights[0][:, None] * rows[first]
    for k in (1, 2, 3):
        total += weights[k][:, None] * rows[first + k]
    return np.asarray(total)


def _lagrange(where: np.ndarray, count: int) -> tuple[np.ndarray, tuple[np.ndarray, ...]]:
    """Return the first of the four rows about each place, and the weights of the four."""
    first = np.clip(np.floor(where).astype(int) - 1, 0, count - 4)
    t = where - first.astype(where.dtype)
    return first, (
        -(t - 1) * (t - 2) * (t - 3) / 6,
        t * (t - 2) * (t - 3) / 2,
        -t * (t - 1) * (t - 3) / 2,
        t * (t - 1) * (t - 2) / 6,
    )


def record_pitch(
    simulation: Simulation, rate_hz: float, margin_s: float, goes_on: bool = False
) -> Pitch | None:
    """Run a uniform machine for one pitch.

    Parameters
    ----------
    simulation : Simulation
    rate_hz : float
        Of the record; must divide the step rate.
    margin_s : float
        Recorded beyond both ends, at least.
    goes_on : bool
        The machine runs already, and goes on from where it stands.

    Returns
    -------
    pitch : Pitch or None
        None where two pitches in succession differ: such a machine must be run at length.

    Raises
    ------
    ExperimentError
        Where the machine cannot be started.
    """
    p, length = simulation.parameters, simulation.path.length_m
    speed = simulation.chain_speed_m_s
    period = p.pitch_m / abs(speed)
    margin = (np.ceil(margin_s * rate_hz) + 2.0) / rate_hz
    every = np.array([(run.EVERYTHING, 0, 0)], dtype=np.int64)
    if not goes_on:
        simulation.start(0.0, is_exact=False)  # one pitch is as good as any other
    before = max(GOES_ON_S if goes_on else LEAD_S, period)
    alone = np.array([(run.CARRIAGE, 0, 0)], dtype=np.int64)
    lead = simulation.advance(_whole(before, rate_hz), rate_hz, alone)
    rows = simulation.advance(_whole(period + 2.0 * margin, rate_hz), rate_hz, every)
    carriage = np.concatenate([lead[:, 0], rows[:, 2]])
    if not _repeats(carriage, period * rate_hz):
        return None
    rack = float(rows[0, 1]) * simulation.dog_pitch + speed * margin
    direction = int(np.sign(speed))
    return Pitch(rows[:, 2:-1], rate_hz, margin, period, direction, length, rack, speed)


def run_periodic(
    simulation: Simulation,
    sensors: tuple[Sensor, ...],
    start_s_m: float,
    duration_s: float,
    rate_hz: float,
) -> Trace | None:
    """Return what a uniform machine's sensors record, out of one pitch.

    Parameters are those of ``run_twin``; None where the machine must be run at length.
    """
    if not is_uniform(simulation.parameters):
        return None
    pitch = record_pitch(simulation, 1.0 / simulation.step_s, 0.0)
    if pitch is None:
        return None
    n = pitch.n_links
    times, places = pitch.places()
    way = pitch.direction * places
    target = way[0] + (pitch.direction * start_s_m - way[0]) % pitch.length_m
    late = float(np.interp(target, way, times))
    clock = np.arange(_samples(duration_s, simulation.step_s, rate_hz)) / rate_hz
    probes = np.array([probe_of(s, n) for s in sensors] + [(run.PLACE, 0, 0)], dtype=np.int64)
    record = pitch.at(late + clock, probes)
    place = np.unwrap(record[:, -1], period=pitch.length_m)
    rack = pitch.rack_m + pitch.speed_m_s * late
    return Trace(clock, record[:, :-1], place, rack)


def _samples(duration_s: float, step_s: float, rate_hz: float) -> int:
    """Return how many samples a run of that duration records."""
    stride = max(1, round(1.0 / (rate_hz * step_s)))
    return -(-round(duration_s / step_s) // stride)


def _whole(duration_s: float, rate_hz: float) -> float:
    """Return a duration rounded up to whole samples."""
    return float(np.ceil(duration_s * rate_hz)) / rate_hz


def _repeats(carriage: Floats, per_pitch: float) -> bool:
    """Tell whether the last pitch of the carriage's motion is that of the pitch before."""
    rows = np.arange(len(carriage))
    last = rows[rows >= len(carriage) - per_pitch]
    apart = carriage[last] - np.interp(last - per_pitch, rows, carriage)
    motion = float(np.std(carriage[last]))
    return float(np.sqrt(np.mean(apart**2))) <= SAME * max(motion, 1e-6)
