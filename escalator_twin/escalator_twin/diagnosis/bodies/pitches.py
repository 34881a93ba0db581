"""A few pitches of the steps stand for all of their travel, where all links are alike.

After a pitch every part has taken the place of the one ahead, and the steps are the same again;
with an eccentric gear they are so after a turn of it. What index k sees then, index k + 1 (or
k + seats) has seen a period before.
"""

from dataclasses import dataclass, replace

import numpy as np

from escalator_twin.machine import Machine, MultibodyMachine, Sensor
from escalator_twin.physics.multibody import loop
from escalator_twin.physics.multibody.probes import probe_of
from escalator_twin.physics.multibody.simulation import MultibodySimulation
from escalator_twin.physics.periodic import between
from escalator_twin.physics.rollout import Trace
from escalator_twin.signals import Experiment, Floats

FINE_HZ = 1000.0  # of the record that is read between its rows
INDEXED = ('link', 'step')  # keys of a sensor's place that count along the chain
LOCAL = ('link', 'axle', 'step', 'steps')  # keys of a deviation's place that single one out
SAME = 0.02  # of the carriage's motion: periods that differ by more are not one another's image
LEAST_M = 1e-6  # of that motion


def index_key(sensor: Sensor) -> str | None:
    """Return the key by which a sensor's place counts along the chain, if it does."""
    return next((key for key in INDEXED if key in sensor.at), None)


def period_of(machine: Machine, experiment: Experiment) -> int | None:
    """Return after how many pitches the steps are the same again; None where they never are."""
    if len(set(experiment.load_per_step_kg)) > 1:
        return None
    if any(key in deviation.location for deviation in machine.deviations for key in LOCAL):
        return None
    assert isinstance(machine, MultibodyMachine)
    turns = any(d.cause == 'gear_eccentricity' for d in machine.deviations)
    return machine.drive.seats if turns else 1


@dataclass(frozen=True)
class Pitches:
    """Two periods of the steps, the second for keeps.

    Attributes
    ----------
    rows : (n, c) float64
        At ``FINE_HZ`` from where a record begins.
    columns : mapping of (sensor's topic and fields, index) to column
    places : (k,) int
        Columns of all axles' path coordinates.
    pitches : int
        In a period, counted along the travel.
    period_s, length_m, step_s : float
    """

    rows: Floats
    columns: dict[tuple[str, int], int]
    places: np.ndarray
    pitches: int
    period_s: float
    length_m: float
    step_s: float

    def trace(self, sensors: tuple[Sensor, ...], duration_s: float, rate_hz: float) -> Trace:
        """Return what sensors record for a while, each row a mean over its interval."""
        n, count = len(self.places), round(FINE_HZ / rate_hz)
        # as many as a simulation of whole steps records
        samples = -(-round(duration_s / self.step_s) // round(1.0 / (rate_hz * self.step_s)))
        times = np.arange(samples * count) / FINE_HZ
        seen = np.empty((len(times), len(sensors)))
        place = np.empty(len(times))
        ahead = np.floor(times / self.period_s).astype(int) - 1
        where = (times - ahead * self.period_s) * FINE_HZ
        for j in np.unique(ahead):
            inside = ahead == j
            picked = [self._column(s, j * self.pitches) for s in sensors]
            first = int(where[inside].min()) - 2
            part = self.rows[first : int(where[inside].max()) + 4]
            at = where[inside] - first
            seen[inside] = between(part[:, picked], at)
            way = np.unwrap(part[:, self.places[j * self.pitches % n]], period=self.length_m)
            place[inside] = between(way[:, None], at)[:, 0]
        columns = seen.reshape(samples, count, -1).mean(axis=1)
        middle = np.unwrap(place, period=self.length_m)[count // 2 :: count]
        return Trace(np.arange(samples) / rate_hz, columns, middle)

    def _column(self, sensor: Sensor, ahead: int) -> int:
        """Return the column that a sensor sees so many pitches later."""
        key = index_key(sensor)
        if key is None:
            return self.columns[kind_of_place(sensor), -1]
        own = sensor.at[key]
        assert isinstance(own, int)
        return self.columns[kind_of_place(sensor), (own + ahead) % len(self.places)]


def kind_of_place(sensor: Sensor) -> str:
    """Return what tells a sensor from others, its index along the chain left out."""
    rest = {key: value for key, value in sensor.at.items() if key not in INDEXED}
    return f'{sensor.quantity} {sorted(rest.items())}'


def record_pitches(
    simulation: MultibodySimulation, sensors: tuple[Sensor, ...], start_s_m: float, pitches: int
) -> Pitches | None:
    """Run two periods from a place; None where they are not each other's image.

    Parameters
    ----------
    simulation : MultibodySimulation
        Of the steps alone.
    sensors : tuple of Sensor
        At any index.
    start_s_m : float
    pitches : int
        In a period.
    """
    machine, n = simulation.machine, simulation.machine.chain.n_links
    columns: dict[tuple[str, int], int] = {}
    probes: list[tuple[int, int, int]] = []
    scales: list[float] = []
    for sensor in sensors:
        key, name = index_key(sensor), kind_of_place(sensor)
        for index in range(n) if key else (-1,):
            if (name, index) in columns:
                continue
            at = {**sensor.at, key: index} if key else sensor.at
            probe, scale = probe_of(replace(sensor, at=at), machine, simulation.layout)
            columns[name, index] = len(probes)
            probes.append(probe)
            scales.append(scale)
    places = len(probes) + np.arange(n)
    probes += [(loop.POINT_PLACE, i, 0) for i in range(n)]
    period = pitches * machine.chain.pitch_m / abs(simulation.speed_m_s)
    simulation.start(start_s_m)
    duration = np.ceil(2.0 * period * FINE_HZ + 8.0) / FINE_HZ
    rows = simulation.advance(float(duration), FINE_HZ, np.array([*probes, (loop.PART_WAY, 0, 0)]))
    carriage = rows[:, -1]
    later = np.arange(round(period * FINE_HZ), round(2.0 * period * FINE_HZ))
    earlier = np.interp(later - period * FINE_HZ, np.arange(len(carriage)), carriage)
    motion = max(float(np.std(carriage[later])), LEAST_M)
    if float(np.sqrt(np.mean((carriage[later] - earlier) ** 2))) > SAME * motion:
        return None
    rows[:, : len(scales)] *= np.array(scales)
    direction = 1 if simulation.speed_m_s > 0.0 else -1
    length = simulation.path.length_m
    step = simulation.step_s
    return Pitches(rows, columns, places, direction * pitches, period, length, step)
