"""What a machine within tolerance may have: knobs of one standard deviation each."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from escalator_twin.machine import Machine
from escalator_twin.signals import Experiment

SMALLEST = 0.05  # of a value: no draw of a tolerance turns a stiffness negative

# A tolerance that does nothing to a machine whose sides are alike, and much to what one side's part
# does to the other.
RACKING = 'chain.racking_stiffness_n_m'

Turn = Callable[[Machine, Experiment, float], tuple[Machine, Experiment]]


@dataclass(frozen=True)
class Knob:
    """One tolerance of the data sheet.

    Attributes
    ----------
    name : str
        Key path in the machine description, or of the experiment.
    turn : callable
        Takes machine, experiment and a number of standard deviations.
    """

    name: str
    turn: Turn


def knobs_of(machine: Machine, experiment: Experiment) -> tuple[Knob, ...]:
    """Return all tolerances that a machine's description gives and an experiment shows."""
    knobs = [_factor(path, sd) for path, sd in machine.tolerances.items()]
    if machine.guide.landing_tol_m > 0.0:
        knobs += [
            _length('guide.lower_landing_m', machine.guide.landing_tol_m),
            _length('guide.upper_landing_m', machine.guide.landing_tol_m),
        ]
    if machine.tensioner.preload_tol > 0.0 and experiment.preload_n > 0.0:
        knobs.append(_preload(machine.tensioner.preload_tol))
    if machine.load.tol > 0.0 and max(experiment.load_per_step_kg) > 0.0:
        knobs.append(_load(machine.load.tol))
    return tuple(knobs)


def turn_all(
    machine: Machine, experiment: Experiment, knobs: tuple[Knob, ...], sizes: Mapping[str, float]
) -> tuple[Machine, Experiment]:
    """Return machine and experiment with several tolerances used up, in standard deviations."""
    for knob in knobs:
        if sizes.get(knob.name, 0.0) != 0.0:
            machine, experiment = knob.turn(machine, experiment, sizes[knob.name])
    return machine, experiment


def _changed(machine: Machine, path: str, change: Callable[[float], float]) -> Machine:
    """Return ``machine`` with one number changed; ``path`` is ``part.key``."""
    part, _, key = path.partition('.')
    inner: Any = getattr(machine, part)
    changed: Any = replace(inner, **{key: change(getattr(inner, key))})
    fields: dict[str, Any] = {part: changed}
    return replace(machine, **fields)


def _factor(path: str, sd: float) -> Knob:
    def turn(machine: Machine, experiment: Experiment, z: float) -> tuple[Machine, Experiment]:
        return _changed(machine, path, lambda v: v * max(1.0 + z * sd, SMALLEST)), experiment

    return Knob(path, turn)


def _length(path: str, sd: float) -> Knob:
    def turn(machine: Machine, experiment: Experiment, z: float) -> tuple[Machine, Experiment]:
        return _changed(machine, path, lambda v: v + z * sd), experiment

    return Knob(path, turn)


def _preload(sd: float) -> Knob:
    def turn(machine: Machine, experiment: Experiment, z: float) -> tuple[Machine, Experiment]:
        factor = max(1.0 + z * sd, SMALLEST)
        return machine, replace(experiment, preload_n=experiment.preload_n * factor)

    return Knob('experiment.preload_n', turn)


def _load(sd: float) -> Knob:
    def turn(machine: Machine, experiment: Experiment, z: float) -> tuple[Machine, Experiment]:
        factor = max(1.0 + z * sd, SMALLEST)
        loads = tuple(factor * kg for kg in experiment.load_per_step_kg)
        return machine, replace(experiment, load_per_step_kg=loads)

    return Knob('experiment.load_per_step_kg', turn)
