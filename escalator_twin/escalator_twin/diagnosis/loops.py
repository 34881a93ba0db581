"""One loop of the machine at steady speed, seen from every link and every step.

A closed chain of like links is the same machine again after one pitch of travel, every part
having taken the place of the one before. A deviation bound to one link is therefore run once, at
index 0, with the forces of all links and the accelerations of all steps recorded; at index j it
looks the same as at 0 from a place j parts further. One run stands for all places of the cause.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from scipy import fft

from escalator_twin.machine import Deviation, Machine, Sensor
from escalator_twin.physics import run
from escalator_twin.physics.periodic import between, is_uniform, Pitch, record_pitch
from escalator_twin.physics.rollout import probe_of, Simulation
from escalator_twin.signals import Experiment, Floats
from escalator_twin.twin import make_folded

BAND_HZ = 20.0  # of everything that diagnosis looks at
# Of the simulations, which are many. Below ``BAND_HZ`` a link's force is off by 0.3 to 1 N against a
# step of 0.25 ms, as much as the gauges' noise leaves open (tests/test_diagnosis_loops.py).
STEP_S = 5e-3 / 3.0
GRID_HZ = 50.0  # of the grids along travel, at the real speed
RATE_HZ = 200.0  # of simulated records
MARGIN_S = 1.0  # simulated beyond both ends of a loop: for the low-pass, and for the rack's dogs
# Beyond both ends of a pitch, for the low-pass alone: exp(-12) is left of it.
PITCH_MARGIN_S = 0.25
FILTER_ORDER = 4


@dataclass(frozen=True)
class Frame:
    """The grid along travel that all signals of one experiment share.

    Attributes
    ----------
    pitch_m : float
    n_links : int
    per_pitch : int
        Grid points in a pitch of travel.
    speed_m_s : float
        At which the grid is passed.
    """

    pitch_m: float
    n_links: int
    per_pitch: int
    speed_m_s: float

    @classmethod
    def of(cls, machine: Machine, speed_m_s: float) -> 'Frame':
        """Return the grid that is passed at about ``GRID_HZ``."""
        pitch = machine.chain.pitch_m
        count = max(4, round(pitch * GRID_HZ / speed_m_s))
        return cls(pitch, machine.chain.n_links, count, speed_m_s)

    @property
    def spacing_m(self) -> float:
        """Spacing of the grid, m."""
        return self.pitch_m / self.per_pitch

    @property
    def n_loop(self) -> int:
        """Grid points in a loop."""
        return self.per_pitch * self.n_links

    @property
    def rate_hz(self) -> float:
        """Rate at which the grid is passed, Hz."""
        return self.speed_m_s / self.spacing_m


@dataclass(frozen=True)
class Loop:
    """Recorded columns over one loop of travel, from path coordinate 0 of axle 0.

    Attributes
    ----------
    columns : (n_loop, k) float32
    place_m : (n_loop,) float64
        Path coordinate of axle 0, unwrapped.
    length_m : float
        Of the path, signed as travel.
    rack_m : float
        Travel of the rack, positive as it moves, less travel of the loop; but for whole pitches.
    rolled_m : (n_loop + 1,) float64 or None
        Way that axle 0's rollers have rolled since the run's first sample, signed as travel, also one
        point past the loop: in it more than the path is long by twice the carriage's displacement,
        and by how far from the path's middle they roll through the curves. None where columns of
        everything are not asked for, or one pitch stands for the loop.
    """

    columns: np.ndarray
    place_m: Floats
    length_m: float
    rack_m: float
    rolled_m: Floats | None = None


@dataclass(frozen=True)
class Begin:
    """Where a loop's travel is counted from: at some travel, axle 0 stands at a place.

    A recording's run begins with axle 0 at a place. A machine with a longer landing, a longer chain or a
    carriage that stands elsewhere comes there some millimetres of travel sooner or later.

    Attributes
    ----------
    place_m : float
        Path coordinate of axle 0.
    travel_m : float
    """

    place_m: float
    travel_m: float


Origin = float | Begin | None  # the rack at no travel, an axle's place, or path coordinate 0


def rack_shift(rack_m: float, reference_m: float, pitch_m: float) -> float:
    """Return by how much travel must be shifted for two runs to have their dogs alike, m.

    A run is begun with axle 0 at a place, which a longer chain or a carriage that stands elsewhere
    moves against the rack; what all machines share is the rack, whose travel is counted in pitches.
    """
    return (rack_m - reference_m + 0.5 * pitch_m) % pitch_m - 0.5 * pitch_m


# Causes bound to one link, axle or step, and waves of the drive: beside them the chain is no longer
# the same after a pitch.
LOCAL = frozenset({
    'link_elongation', 'link_stiffness', 'roller_drag', 'roller_eccentricity', 'roller_flat',
    'load_distribution', 'step_mass', 'drive_ripple', 'drive_hunting',
})  # fmt: skip


def alike(machine: Machine, experiment: Experiment) -> tuple[Machine, Experiment]:
    """Return a machine without what singles out one link, axle or step, equally loaded.

    It is the same again after every pitch, and quickly run; what a tolerance or the rail does to it
    is next to what they do to the machine itself.
    """
    kept = tuple(d for d in machine.deviations if d.cause not in LOCAL)
    loads = experiment.load_per_step_kg
    return replace(machine, deviations=kept), replace(
        experiment, load_per_step_kg=(float(np.mean(loads)),)
    )


def sensor_probes(sensors: tuple[Sensor, ...], n_links: int) -> np.ndarray:
    """Return the probes of some sensors, (k, 3)."""
    return np.array([probe_of(s, n_links) for s in sensors], dtype=np.int64)


def all_probes() -> np.ndarray:
    """Return the probe of everything: carriage, all links of both sides, all steps."""
    return np.array([(run.EVERYTHING, 0, 0)], dtype=np.int64)


def simulate_loop(
    machine: Machine,
    experiment: Experiment,
    frame: Frame,
    probes: np.ndarray,
    deviations: tuple[Deviation, ...] = (),
    origin: Origin = None,
) -> Loop:
    """Simulate one loop, from about path coordinate 0 on, and put it onto the grid.

    Parameters
    ----------
    machine : Machine
    experiment : Experiment
        ``set_speed_m_s`` is that of the frame.
    frame : Frame
    probes : (k, 3) int64
    deviations : tuple of Deviation
        Beside those of the machine.
    origin : float or Begin, optional
        From where travel is counted: as in a loop with this ``rack_m``, so that the rack's dogs stand
        alike; or as a recording's run begins.
    """
    machine = replace(machine, deviations=(*machine.deviations, *deviations))
    simulation = built(machine, experiment)
    length = simulation.path.length_m
    if is_uniform(simulation.parameters):
        pitch = record_pitch(simulation, RATE_HZ, PITCH_MARGIN_S)
        if pitch is not None:
            return _tiled(pitch, frame, probes, origin)
        simulation = built(machine, experiment)
    speed = simulation.chain_speed_m_s
    simulation.start((-speed * MARGIN_S) % length)
    is_all = bool(probes[0, 0] == run.EVERYTHING)
    place = np.array([(run.PLACE, 0, 0), (run.RACK, 0, 0)], dtype=np.int64)
    duration = frame.n_loop * frame.spacing_m / frame.speed_m_s + 2.0 * MARGIN_S
    record = simulation.advance(
        duration, RATE_HZ, probes if is_all else np.vstack([place, probes])
    )
    grid = np.asarray(np.arange(frame.n_loop + 1) * frame.spacing_m, np.float64)
    way = float(record[0, 1]) * simulation.dog_pitch
    rack = way * experiment.direction + abs(speed) * MARGIN_S
    unwrapped = np.unwrap(record[:, 0], period=length)
    unwrapped -= length * np.round(unwrapped[0] / length)
    travel = (np.arange(len(unwrapped)) / RATE_HZ - MARGIN_S) * abs(speed)
    shift = _shift(origin, rack, travel, unwrapped, length, frame.pitch_m)
    where = ((grid - shift) / abs(speed) + MARGIN_S) * RATE_HZ
    seen = record[:, 2 : 3 + 5 * frame.n_links] if is_all else record[:, 2:]
    inside, rows = where[:-1], np.arange(len(unwrapped))
    return Loop(
        between(band_limited(seen.astype(np.float32), RATE_HZ), inside),
        np.interp(inside, rows, unwrapped),
        float(length * experiment.direction),
        rack - shift,
        np.interp(where, rows, record[:, -1]) if is_all else None,
    )


def _shift(
    origin: Origin,
    rack_m: float,
    travel_m: Floats,
    place_m: Floats,
    length_m: float,
    pitch_m: float,
) -> float:
    """Return what is to be added to a loop's travel for it to be counted from an origin, m.

    ``place_m`` is the path coordinate of axle 0, unwrapped, at ``travel_m``.
    """
    if origin is None:
        return 0.0
    if isinstance(origin, Begin):
        direction = np.sign(place_m[-1] - place_m[0])
        way = direction * place_m
        target = way[0] + (direction * origin.place_m - way[0]) % length_m
        here = float(np.interp(target, way, travel_m))
        return rack_shift(origin.travel_m, here, pitch_m)
    return rack_shift(rack_m, origin, pitch_m)


def built(machine: Machine, experiment: Experiment) -> Simulation:
    return make_folded(machine, experiment, STEP_S)


def simulate_rails(
    machine: Machine,
    experiment: Experiment,
    frame: Frame,
    probes: np.ndarray,
    rails: Sequence[Floats],
    jobs: int = 1,
    origin: Origin = None,
) -> list[np.ndarray]:
    """Simulate one loop with each of several small deviations of the rail.

    Parameters
    ----------
    machine : Machine
        Of which all links are alike, see ``alike``.
    experiment : Experiment
        ``set_speed_m_s`` is that of the frame.
    frame : Frame
    probes : (k, 3) int64
    rails : sequence of (n, 2) float64
        What the guide has beyond its survey: m and its slope, see `Simulation.lay`.
    jobs : int
        Simulations at a time.
    origin : float or Begin, optional
        Of travel, see `simulate_loop`.

    Returns
    -------
    changes : list of (n_loop, k) float32
        One for each rail that the machine runs over steadily.
    """
    first = built(machine, experiment)
    assert is_uniform(first.parameters), 'one pitch stands for no other machine'
    first.start(0.0)
    kept = first.keep()

    def runs(simulation: Simulation, rail: Floats | None, origin: Origin) -> Loop | None:
        simulation.back_to(kept)
        if rail is not None:
            simulation.lay(rail)
        pitch = record_pitch(simulation, RATE_HZ, PITCH_MARGIN_S, goes_on=True)
        return None if pitch is None else _tiled(pitch, frame, probes, origin)

    base = runs(first, None, origin)
    if base is None:
        return []

    def some(part: Sequence[Floats]) -> list[np.ndarray | None]:
        simulation = built(machine, experiment)
        loops = (runs(simulation, rail, base.rack_m) for rail in part)
        return [None if loop is None else loop.columns - base.columns for loop in loops]

    count = max(1, jobs)
    with ThreadPoolExecutor(count) as pool:
        parts = pool.map(some, [rails[k::count] for k in range(count)])
    # in the rails' order, however many ran at a time: what follows must not hang on that
    found: list[np.ndarray | None] = [None] * len(rails)
    for k, part in enumerate(parts):
        found[k::count] = part
    return [change for change in found if change is not None]


def _tiled(pitch: Pitch, frame: Frame, probes: np.ndarray, origin: Origin) -> Loop:
    """Put the loop of a uniform machine together from one pitch of it."""
    times, places = pitch.places()
    n, d, period, length = pitch.n_links, pitch.direction, pitch.period_s, pitch.length_m
    # the loop begins with axle 0 at path coordinate 0
    way = d * places
    begin = float(np.interp(way[0] + (-way[0]) % length, way, times)) % (n * period)
    rack = d * (pitch.rack_m + pitch.speed_m_s * begin)
    travel = abs(pitch.speed_m_s) * (times - begin)
    shift = _shift(origin, rack, travel, places, length, frame.pitch_m)
    first = begin - shift / abs(pitch.speed_m_s)
    # the grid's points lie at the same phases in every pitch
    grid = first + np.arange(frame.per_pitch) * (period / frame.per_pitch)
    turn = np.floor(grid / period).astype(int)
    where = (grid - turn * period + pitch.margin_s) * pitch.rate_hz
    seen = pitch.rows[:, : 1 + 5 * n].astype(np.float32)
    phases = between(band_limited(seen, pitch.rate_hz), where)
    is_all = bool(probes[0, 0] == run.EVERYTHING)
    columns = np.empty((n, frame.per_pitch, 1 + 5 * n if is_all else len(probes)), np.float32)
    for at in np.unique(turn):
        rows = turn == at
        ahead = np.arange(n) + int(at)
        picked = (
            _all_columns(n, d * ahead)
            if is_all
            else np.stack([pitch.column(probe, ahead) for probe in probes], axis=1)
        )
        columns[:, rows] = phases[rows][:, picked].swapaxes(0, 1)
    clock = first + np.arange(frame.n_loop) * (period / frame.per_pitch)
    loops = np.floor(clock / (n * period))
    place = np.interp(clock - loops * n * period, times, places) + d * length * loops
    place -= length * np.round(place[0] / length)
    return Loop(columns.reshape(frame.n_loop, -1), place, float(length * d), rack - shift)


def _all_columns(n: int, ahead: np.ndarray) -> np.ndarray:
    """Return the columns of all probes, every part some places further, (len(ahead), 1 + 5 n)."""
    place = (np.arange(n) + ahead[:, None]) % n
    carriage = np.zeros((len(ahead), 1), place.dtype)
    return np.concatenate([carriage, *(1 + k * n + place for k in range(5))], axis=1)


def band_limited(values: np.ndarray, rate_hz: float) -> np.ndarray:
    """Return columns (n, k) behind a zero-phase low-pass of ``BAND_HZ``.

    The magnitude is that of a Butterworth filter of order 4 run forwards and backwards; the ends
    are continued, mirrored in their end points.
    """
    n = len(values)
    pad = min(n - 1, round(4.0 * rate_hz / BAND_HZ))
    head = 2.0 * values[0] - values[pad:0:-1]
    tail = 2.0 * values[-1] - values[-2 : -pad - 2 : -1]
    whole = np.concatenate([head, values, tail])
    # a straight line from end to end goes round the seam of the transform unharmed
    line = np.linspace(0.0, 1.0, len(whole), dtype=values.dtype)[:, None]
    line = line * (whole[-1] - whole[0]) + whole[0]
    size = fft.next_fast_len(len(whole), real=True)
    spectrum = fft.rfft(whole - line, size, axis=0)
    frequency = np.fft.rfftfreq(size, 1.0 / rate_hz)
    gain = 1.0 / (1.0 + (frequency / BAND_HZ) ** (2 * FILTER_ORDER))
    spectrum *= gain.astype(values.dtype)[:, None]
    smooth: np.ndarray = fft.irfft(spectrum, size, axis=0)[: len(whole)] + line
    return smooth[pad : pad + n]
