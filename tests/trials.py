"""Short runs of the prototype with deviations, for tests of causes."""

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from escalator_twin.causes import apply, CAUSES
from escalator_twin.instruments import recorded_sensors
from escalator_twin.machine import Deviation, load_machine, Machine, Sensor
from escalator_twin.physics.rollout import Simulation, Trace
from escalator_twin.signals import Experiment, Floats
from escalator_twin.twin import make_simulation, run_twin

ROOT = Path(__file__).resolve().parents[1]
RATE_HZ = 200.0


@cache
def prototype() -> Machine:
    return load_machine(ROOT / 'config' / 'machines' / 'prototype.yaml')


@cache
def toy() -> Machine:
    return load_machine(Path(__file__).parent / 'data' / 'toy.yaml')


def smooth_prototype() -> Machine:
    """Return the prototype on ideal rails, for closed forms."""
    machine = prototype()
    return replace(machine, guide=replace(machine.guide, survey_file=None))


def case(
    speed: float = 0.5, direction: int = 1, load: float = 75.0, preload: float = 3000.0
) -> Experiment:
    return Experiment(speed, direction, (load,), preload)


def probe(quantity: str, **at: object) -> Sensor:
    """Return a sensor of the model that no machine describes."""
    name = '_'.join(str(v) for v in at.values())
    return Sensor('probe', f'{quantity}_{name}', quantity, dict(at), '', '', '', ('x',), RATE_HZ)


def link(index: int, side: str = 'left') -> Sensor:
    return probe('link_force', link=index % 60, side=side)


CARRIAGE = probe('carriage_displacement')


@dataclass(frozen=True)
class Trial:
    """A run: time, place of axle 0, one column a sensor, and the simulation as it ended."""

    time_s: Floats
    place_m: Floats
    columns: Floats
    simulation: Simulation


def trial(
    deviations: tuple[Deviation, ...] = (),
    sensors: tuple[Sensor, ...] = (),
    experiment: Experiment | None = None,
    start_s_m: float = 5.0,
    duration_s: float = 4.0,
    machine: Machine | None = None,
    planar: bool = False,
) -> Trial:
    """Run a machine with deviations for a while."""
    machine = machine or prototype()
    simulation = make_simulation(apply(machine, deviations), experiment or case(), planar)
    sensors = sensors or machine.instruments.sensors
    run = run_twin(simulation, sensors, start_s_m, duration_s, RATE_HZ)
    return Trial(run.time_s, run.place_m, run.columns, simulation)


def deviation(cause: str, location: dict[str, object] | None = None, **sizes: float) -> Deviation:
    """Return a deviation; sizes left out are those of the reference."""
    references = CAUSES[cause].references
    known = dict(references[0]) if references else {}
    return Deviation(cause, {**known, **sizes}, location or {})


PLACES: dict[str, object] = {
    'link': 0, 'axle': 0, 'step': 0, 'side': 'left', 's_m': 3.0, 's_from_m': 4.0, 's_to_m': 8.0,
    'which': 'upper', 'steps': [2, 3, 4],
}  # fmt: skip
NAMES: dict[str, object] = {
    'link': 'left_a', 'links': ['left_a', 'right_b'], 'gauge': 2, 'axis': 'x',
    'channel': 'left_a', 'channels': ['left_a', 'left_b'],
}  # fmt: skip


def example(name: str) -> dict[str, object]:
    """Return a location of a cause in the prototype."""
    cause = CAUSES[name]
    known = PLACES if cause.of_machine else NAMES
    return {place.key: known[place.key] for place in cause.places}


def changed(one: Trial, other: Trial) -> Floats:
    """Return how the columns of two runs differ, their means removed: (n, k)."""
    n = min(len(one.columns), len(other.columns))
    difference = one.columns[:n] - other.columns[:n]
    return np.asarray(difference - difference.mean(axis=0))


def analytic(machine: Machine, seconds: float = 40.0, rate_hz: float = 1000.0) -> Trace:
    """Return smooth signals of the size that instruments see, one column a sensor."""
    time = np.arange(round(seconds * rate_hz) + 1) / rate_hz
    size = {'link_force': 800.0, 'roller_normal_force': 300.0, 'carriage_displacement': 2e-3}
    columns = [
        size.get(s.quantity, 3.0) * (1.5 + np.sin((2.0 + 0.3 * i) * time + i))
        for i, s in enumerate(recorded_sensors(machine))
    ]
    return Trace(time, np.column_stack(columns), 0.5 * time)
