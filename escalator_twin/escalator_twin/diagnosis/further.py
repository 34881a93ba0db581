"""Which further recording would decide what one has left open."""

from dataclasses import dataclass, replace

import numpy as np

from escalator_twin.causes.application import apply
from escalator_twin.diagnosis.context import Context
from escalator_twin.diagnosis.floor import is_shaken
from escalator_twin.diagnosis.free import of_machine
from escalator_twin.diagnosis.grids import Frame
from escalator_twin.diagnosis.loops import sensor_probes, simulate_loop
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.whitening import sensor_variance
from escalator_twin.errors import EscalatorError
from escalator_twin.machine import Machine
from escalator_twin.signals import Experiment, Floats

SPEEDS_M_S = (0.25, 0.5)
LOADS_KG = (0.0, 75.0)
PRELOADS_N = (3000.0, 6000.0)


@dataclass(frozen=True)
class Further:
    """A further experiment and what it would tell.

    Attributes
    ----------
    experiment : Experiment
    nats : float
        By which it is expected to tell two explanations apart, at most: tolerances may take some.
    """

    experiment: Experiment
    nats: float

    @property
    def text(self) -> str:
        """The experiment in words."""
        e = self.experiment
        way = 'up' if e.direction > 0 else 'down'
        load = f'{e.load_per_step_kg[0]:.0f} kg a step' if max(e.load_per_step_kg) else 'empty'
        return f'{e.set_speed_m_s:g} m/s {way}, {load}, preload {e.preload_n:.0f} N'


def nearby(experiment: Experiment) -> list[Experiment]:
    """Return the experiments that differ in one factor of the plan, speed first.

    Parameters
    ----------
    experiment : Experiment
        The one that was done.
    """
    speed = _other(experiment.set_speed_m_s, SPEEDS_M_S)
    load = _other(max(experiment.load_per_step_kg), LOADS_KG)
    preload = _other(experiment.preload_n, PRELOADS_N)
    return [
        replace(experiment, set_speed_m_s=speed),
        replace(experiment, direction=-experiment.direction),
        replace(experiment, load_per_step_kg=(load,)),
        replace(experiment, preload_n=preload),
    ]


def _other(value: float, levels: tuple[float, float]) -> float:
    """Return the level that is farther from a value."""
    return max(levels, key=lambda level: abs(level - value))


def decide_between(context: Context, one: Proposal, other: Proposal | None) -> Further | None:
    """Return the experiment, one factor away, in which two explanations differ most.

    Parameters
    ----------
    context : Context
        Of the recording that leaves them open.
    one : Proposal
        Of the machine.
    other : Proposal or None
        Of the machine; None: no effect at all.

    Returns
    -------
    further : Further or None
        None where one of them is a fault of the measurement, or cannot be run.
    """
    if not of_machine(one) or (other is not None and not of_machine(other)):
        return None
    best: Further | None = None
    machine = context.machine
    for experiment in nearby(context.setting.experiment):
        try:
            first = _loop(apply(machine, (one.deviation,)), experiment)
            deviations = () if other is None else (other.deviation,)
            second = _loop(apply(machine, deviations), experiment)
        except EscalatorError:
            continue
        nats = _apart(context, experiment, first - second)
        if best is None or nats > best.nats:
            best = Further(experiment, nats)
    return best


def _loop(machine: Machine, experiment: Experiment) -> Floats:
    """Return what the machine's sensors would see in one loop, (n_loop, c)."""
    frame = Frame.of(machine, experiment.set_speed_m_s)
    probes = sensor_probes(machine.instruments.sensors, machine.chain.n_links)
    return simulate_loop(machine, experiment, frame, probes).columns.astype(np.float64)


def _apart(context: Context, experiment: Experiment, difference: Floats) -> float:
    """Return half the squared difference over the noise, at the temperature of the verdict."""
    machine = context.machine
    rate = Frame.of(machine, experiment.set_speed_m_s).rate_hz
    total = 0.0
    for k, sensor in enumerate(machine.instruments.sensors):
        if is_shaken(sensor):
            continue
        centred = difference[:, k] - difference[:, k].mean()
        total += float(np.sum(centred**2)) / sensor_variance(sensor, rate)
    return 0.5 * total / context.floor.temperature
