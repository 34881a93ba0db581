"""Run the parts of a machine of free bodies, each by itself: steps and handrail do not touch."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from escalator_twin.causes.registry import KNOWN
from escalator_twin.comparison.locate import RATE_HZ, Setting
from escalator_twin.diagnosis.bodies.pitches import period_of, record_pitches
from escalator_twin.machine import Deviation, Machine, Sensor
from escalator_twin.physics.multibody.probes import ON_HANDRAIL
from escalator_twin.physics.multibody.simulation import MultibodySimulation
from escalator_twin.physics.rollout import Trace
from escalator_twin.signals import Experiment, Floats
from escalator_twin.twin import make_simulation, run_twin

STEPS, HANDRAIL = 'steps', 'handrail'
RAIL_S = 6.0  # of a handrail's run, of which the mean is taken: some fifteen of its bodies pass


def part_of(sensor: Sensor) -> str:
    """Return the part of the machine that a sensor looks at."""
    return HANDRAIL if sensor.quantity in ON_HANDRAIL else STEPS


def acts_on(cause: str) -> str:
    """Return the part of the machine that a cause changes."""
    quantities = KNOWN[cause].acts_on
    rail = quantities and all(quantity in ON_HANDRAIL for quantity in quantities)
    return HANDRAIL if rail else STEPS


def of_part(deviations: Sequence[Deviation], part: str) -> tuple[Deviation, ...]:
    """Return the deviations of one part."""
    return tuple(d for d in deviations if acts_on(d.cause) == part)


def run_part(
    machine: Machine,
    experiment: Experiment,
    part: str,
    sensors: tuple[Sensor, ...],
    start_s_m: float,
    duration_s: float,
) -> Trace:
    """Run one part of a machine with its deviations and record some of its sensors."""
    alone = replace(machine, deviations=of_part(machine.deviations, part))
    simulation = make_simulation(alone, experiment, parts=(part,))
    assert isinstance(simulation, MultibodySimulation)
    pitches = period_of(alone, experiment) if part == STEPS else None
    if pitches is not None and simulation.speed_m_s != 0.0:
        found = record_pitches(simulation, sensors, start_s_m, pitches)
        if found is not None:
            return found.trace(sensors, duration_s, RATE_HZ)
    return run_twin(simulation, sensors, start_s_m, duration_s, RATE_HZ)


@dataclass(frozen=True)
class Runs:
    """Runs beside one recording; what was run is not run again.

    The handrail keeps its own pace and no instrument tells where its bodies are: what is told of
    it is the mean of every channel, as a column that does not change.

    Attributes
    ----------
    setting : Setting
    known : dict
        Steps' runs and the handrail's means, by part and deviations.
    """

    setting: Setting
    known: dict[tuple[str, str], object] = field(default_factory=dict)

    def trace(self, machine: Machine, experiment: Experiment | None = None) -> Trace:
        """Run a machine beside the recording; columns in the order of its sensors.

        With an ``experiment`` of its own nothing is kept: a tolerance is turned.
        """
        setting = experiment or self.setting.experiment
        steps = self._steps(machine, setting, experiment is None)
        columns = np.empty((len(steps.time_s), len(machine.instruments.sensors)))
        parts = np.array([part_of(s) for s in machine.instruments.sensors])
        columns[:, parts == STEPS] = steps.columns
        if (parts == HANDRAIL).any():
            columns[:, parts == HANDRAIL] = self.rail_means(machine)
        return replace(steps, columns=columns)

    def _steps(self, machine: Machine, experiment: Experiment, keep: bool) -> Trace:
        key = STEPS, repr(of_part(machine.deviations, STEPS))
        found = self.known.get(key) if keep else None
        if found is None:
            sensors = tuple(s for s in machine.instruments.sensors if part_of(s) == STEPS)
            start, duration = self.setting.start_s_m, self.setting.duration_s
            found = run_part(machine, experiment, STEPS, sensors, start, duration)
            if keep:
                self.known[key] = found
        assert isinstance(found, Trace)
        return found

    def rail_means(self, machine: Machine) -> Floats:
        """Return the means of the handrail's channels, (k,)."""
        key = HANDRAIL, repr(of_part(machine.deviations, HANDRAIL))
        found = self.known.get(key)
        if found is None:
            sensors = tuple(s for s in machine.instruments.sensors if part_of(s) == HANDRAIL)
            run = run_part(machine, self.setting.experiment, HANDRAIL, sensors, 0.0, RAIL_S)
            found = self.known[key] = run.columns.mean(axis=0)
        assert isinstance(found, np.ndarray)
        return found


def whole_trace(machine: Machine, runs: Runs) -> Trace:
    """Run a machine beside a recording with its handrail in motion, for comparisons."""
    trace = runs.trace(machine)
    parts = np.array([part_of(s) for s in machine.instruments.sensors])
    if not (parts == HANDRAIL).any():
        return trace
    sensors = tuple(s for s in machine.instruments.sensors if part_of(s) == HANDRAIL)
    experiment, duration = runs.setting.experiment, runs.setting.duration_s
    rail = run_part(machine, experiment, HANDRAIL, sensors, 0.0, duration)
    columns = trace.columns.copy()
    columns[:, parts == HANDRAIL] = rail.columns
    return replace(trace, columns=columns)
