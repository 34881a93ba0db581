"""The twin of a machine in an experiment: mechanics with its deviations, ready to run."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from escalator_twin.causes import alter_layout, alter_machine, alter_parameters
from escalator_twin.machine import Machine, MultibodyMachine, Sensor
from escalator_twin.physics.multibody.layout import lay_out, Layout, PARTS
from escalator_twin.physics.multibody.simulation import MultibodySimulation
from escalator_twin.physics.parameters import has_like_sides, make_parameters, Parameters
from escalator_twin.physics.path import build_path
from escalator_twin.physics.rollout import Simulation, STEP_S, Trace
from escalator_twin.signals import Experiment

CHUNK_S = 5.0  # simulated between two reports of progress

Progress = Callable[[float, float], None]
AnySimulation = Simulation | MultibodySimulation


def make_simulation(
    machine: Machine,
    experiment: Experiment,
    planar: bool = False,
    step_s: float | None = None,
    parts: tuple[str, ...] = PARTS,
) -> AnySimulation:
    """Build the simulation of a machine, its deviations applied, in an experiment.

    Parameters
    ----------
    machine : Machine
        Its ``deviations`` are applied in their order; see the causes.
    experiment : Experiment
        ``set_speed_m_s`` is the rack's real speed.
    planar : bool
        Lump both sides into one.
    step_s : float, optional
        Time step, s; by default that of the machine's kind.
    parts : tuple of str
        Of a machine of free bodies: those that run.

    Raises
    ------
    MachineError
        Where a deviation names a cause, a key, a place or a size that there is not.
    ExperimentError
        Where a list of loads has another length than the chain has steps.
    """
    altered = alter_machine(machine)
    if isinstance(altered, MultibodyMachine):
        return MultibodySimulation(altered, _layout(altered, experiment, parts), step_s)
    parameters = alter_parameters(make_parameters(altered, experiment, planar), altered)
    return _linked(altered, parameters, step_s or STEP_S)


def make_folded(machine: Machine, experiment: Experiment, step_s: float) -> Simulation:
    """Build the simulation of a linked chain, both sides lumped into one where they are alike.

    Two sides alike move alike, and one that stands for both is run in 0.6 of the time: what a
    sensor of either side sees is the same (tests/test_physics_periodic.py).

    Parameters are those of `make_simulation`.
    """
    altered = alter_machine(machine)
    parameters = alter_parameters(make_parameters(altered, experiment), altered)
    if has_like_sides(parameters):
        parameters = alter_parameters(make_parameters(altered, experiment, planar=True), altered)
    return _linked(altered, parameters, step_s)


def _linked(machine: Machine, parameters: Parameters, step_s: float) -> Simulation:
    """Build a chain of links on the guide that its deviations left."""
    path = replace(build_path(machine.guide), segments=parameters.segments)
    return Simulation(machine, parameters, path, step_s)


def _layout(machine: MultibodyMachine, experiment: Experiment, parts: tuple[str, ...]) -> Layout:
    """Return the network of a machine, its deviations applied."""
    return alter_layout(lay_out(machine, experiment, parts), machine)


def run_twin(
    simulation: AnySimulation,
    sensors: tuple[Sensor, ...],
    start_s_m: float,
    duration_s: float,
    rate_hz: float,
    progress: Progress | None = None,
) -> Trace:
    """Start a simulation at a loop position and record sensors for a while.

    Parameters
    ----------
    simulation : Simulation or MultibodySimulation
    sensors : tuple of Sensor
    start_s_m : float
        Path coordinate of axle 0 at the first sample, m.
    duration_s : float
    rate_hz : float
        Of the record; must divide the step rate.
    progress : callable, optional
        Gets (done, total) in simulated seconds.
    """
    simulation.start(start_s_m)
    traces, done = [], 0.0
    while done < duration_s:
        part = min(CHUNK_S, duration_s - done)
        traces.append(simulation.trace(part, rate_hz, sensors))
        done += part
        if progress is not None:
            progress(done, duration_s)
    columns = np.concatenate([t.columns for t in traces])
    place = np.unwrap(np.concatenate([t.place_m for t in traces]), period=simulation.path.length_m)
    return Trace(np.arange(len(columns)) / rate_hz, columns, place, traces[0].rack_m)
