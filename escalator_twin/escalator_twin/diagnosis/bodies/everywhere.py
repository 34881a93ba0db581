"""One loop of the steps seen from every link, roller and step, and a cause at any index.

A closed chain of like links is the same machine again after one pitch of travel: a deviation at
index 0, run once with every sensor at every index, stands for all places (see ``loops``).
"""

from dataclasses import dataclass, replace

import numpy as np

from escalator_twin.causes.application import apply
from escalator_twin.comparison.locate import MARGIN_M, RATE_HZ
from escalator_twin.diagnosis.bodies.pitches import index_key
from escalator_twin.diagnosis.bodies.running import part_of, run_part, STEPS
from escalator_twin.diagnosis.grids import band_limited, Frame
from escalator_twin.diagnosis.observation import Observation
from escalator_twin.machine import Deviation, Machine, Sensor
from escalator_twin.physics.periodic import between
from escalator_twin.physics.rollout import Trace
from escalator_twin.signals import Experiment
from escalator_twin.sync.template import make_template, Template

LEAD_M = 0.6  # of travel before and after the loop, for the low-pass


def everywhere(machine: Machine) -> tuple[tuple[Sensor, ...], dict[str, slice]]:
    """Return the steps' sensors at every index of the chain, and each channel's columns."""
    sensors: list[Sensor] = []
    blocks = {}
    for sensor in machine.instruments.sensors:
        if part_of(sensor) != STEPS:
            continue
        key, first = index_key(sensor), len(sensors)
        if key is None:
            sensors.append(sensor)
        else:
            n = machine.chain.n_links
            sensors += [replace(sensor, at={**sensor.at, key: i}) for i in range(n)]
        blocks[sensor.channel] = slice(first, len(sensors))
    return tuple(sensors), blocks


@dataclass(frozen=True)
class Everywhere:
    """A run over a loop and a little more, begun ``LEAD_M`` before path coordinate 0.

    Attributes
    ----------
    trace : Trace
    blocks : mapping of channel to slice
        Columns of a channel, one an index of the chain or one in all.
    speed_m_s : float
    """

    trace: Trace
    blocks: dict[str, slice]
    speed_m_s: float

    def on_loop(self, frame: Frame) -> np.ndarray:
        """Return the columns on the grid of a loop, (n_loop, k) float32."""
        way = np.arange(frame.n_loop) * frame.spacing_m + LEAD_M
        where = np.asarray(way / self.speed_m_s * RATE_HZ, np.float64)
        smooth = band_limited(self.trace.columns.astype(np.float32), RATE_HZ)
        return between(smooth, where)

    def place_on(self, frame: Frame, length_m: float) -> np.ndarray:
        """Return the path coordinate of axle 0 on that grid, unwrapped, about 0 at first."""
        where = (np.arange(frame.n_loop) * frame.spacing_m + LEAD_M) / self.speed_m_s
        place = np.interp(where, self.trace.time_s, self.trace.place_m)
        return np.asarray(place - length_m * np.round(place[0] / length_m))

    def template(self, machine: Machine) -> Template:
        """Return the loop as placing a recording wants it: the steps' channels alone."""
        sensors = machine.instruments.sensors
        channels = tuple(s.channel for s in sensors if s.channel in self.blocks)
        picked = []
        for channel in channels:
            sensor = machine.instruments.sensor(channel)
            key = index_key(sensor)
            offset = sensor.at[key] if key is not None else 0
            assert isinstance(offset, int)
            picked.append(self.blocks[channel].start + offset)
        travel = self.trace.time_s * self.speed_m_s - LEAD_M
        keep = travel > -0.02  # a little before 0, so that it can be interpolated there
        loop = machine.chain.n_links * machine.chain.pitch_m
        rows = self.trace.columns[keep][:, picked]
        return make_template(channels, rows, self.trace.place_m[keep], travel[keep], loop)


def run_everywhere(
    machine: Machine,
    experiment: Experiment,
    length_m: float,
    deviations: tuple[Deviation, ...] = (),
) -> Everywhere:
    """Run the steps over a loop; ``length_m`` is that of the path of axle 0."""
    sensors, blocks = everywhere(machine)
    speed = experiment.set_speed_m_s
    loop = machine.chain.n_links * machine.chain.pitch_m
    duration = (loop + 2.0 * LEAD_M + MARGIN_M) / speed
    start = (-experiment.direction * LEAD_M) % length_m
    deviated = apply(machine, deviations)
    trace = run_part(deviated, experiment, STEPS, sensors, start, duration)
    return Everywhere(trace, blocks, speed)


def at_index(
    response: np.ndarray,
    blocks: dict[str, slice],
    observation: Observation,
    machine: Machine,
    direction: int,
    index: int,
) -> np.ndarray:
    """Return a response, taken with the cause at index 0, as seen with it at ``index``: (n, c).

    Parameters
    ----------
    response : (n_loop, k) float32
    blocks : mapping of channel to slice
    observation : Observation
    machine : Machine
    direction : int
    index : int
    """
    frame = observation.frame
    rows = (observation.index + direction * index * frame.per_pitch) % frame.n_loop
    seen = np.zeros((len(rows), len(observation.channels)), np.float32)
    for k, channel in enumerate(observation.channels):
        if channel not in blocks:
            continue
        sensor = machine.instruments.sensor(channel)
        key, column = index_key(sensor), blocks[channel].start
        if key is not None:
            own = sensor.at[key]
            assert isinstance(own, int)
            column += (own - index) % machine.chain.n_links
        seen[:, k] = response[rows, column]
    return seen
