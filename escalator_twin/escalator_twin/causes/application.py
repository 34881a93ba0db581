"""Apply the deviations of a machine: to its numbers, its instruments and its recordings."""

from dataclasses import dataclass, replace

import numpy as np

from escalator_twin.causes.base import Cause
from escalator_twin.causes.imperfections import Imperfections
from escalator_twin.causes.registry import KNOWN
from escalator_twin.errors import MachineError
from escalator_twin.machine import Deviation, Machine, MultibodyMachine
from escalator_twin.physics.multibody.layout import Layout
from escalator_twin.physics.parameters import Parameters
from escalator_twin.signals import Recording


@dataclass(frozen=True)
class Applied:
    """One deviation, checked: its cause, where it sits and how large it is."""

    cause: Cause
    location: dict[str, object]
    theta: dict[str, float]


def check(machine: Machine, deviations: tuple[Deviation, ...]) -> tuple[Applied, ...]:
    """Check deviations against the registry and the machine.

    Raises
    ------
    MachineError
        On an unknown cause, key or place, or a number out of its bounds; the message gives
        file, number of the deviation, cause, key, what was expected and found.
    """
    applied = []
    for i, deviation in enumerate(deviations):
        where = f'{machine.source or machine.name}.deviations[{i}]'
        cause = KNOWN.get(deviation.cause)
        if cause is None:
            raise MachineError(
                f'{where}.cause: expected one of {", ".join(KNOWN)}, found {deviation.cause!r}'
            )
        if not cause.acts_in(machine):
            known = ', '.join(name for name, one in KNOWN.items() if one.acts_in(machine))
            raise MachineError(
                f'{where}.cause: expected one of a machine of {machine.physics}: {known}; '
                f'found {deviation.cause!r}'
            )
        try:
            location = cause.locate(deviation.location, machine)
            theta = cause.complete(deviation.parameters)
        except MachineError as error:
            raise MachineError(f'{where} ({cause.name}).{error}') from None
        applied.append(Applied(cause, location, theta))
    return tuple(applied)


def apply(machine: Machine, deviations: tuple[Deviation, ...]) -> Machine:
    """Return ``machine`` with more deviations, checked.

    They act in the order in which they are listed, on what the earlier ones left.
    """
    extended = replace(machine, deviations=(*machine.deviations, *deviations))
    check(extended, extended.deviations)
    return extended


def alter_machine(machine: Machine) -> Machine:
    """Return ``machine`` with the numbers that its deviations give it."""
    for item in check(machine, machine.deviations):
        if item.cause.alter_machine is not None:
            machine = item.cause.alter_machine(machine, item.location, item.theta)
    return machine


def alter_parameters(parameters: Parameters, machine: Machine) -> Parameters:
    """Return the force law's numbers as the machine's deviations leave them."""
    for item in check(machine, machine.deviations):
        if item.cause.alter_parameters is not None:
            hook = item.cause.alter_parameters
            parameters = hook(parameters, machine, item.location, item.theta)
    return parameters


def alter_layout(layout: Layout, machine: MultibodyMachine) -> Layout:
    """Return a network of free bodies as the machine's deviations leave it."""
    for item in check(machine, machine.deviations):
        if item.cause.alter_layout is not None:
            layout = item.cause.alter_layout(layout, machine, item.location, item.theta)
    return layout


def alter_imperfections(
    imperfections: Imperfections, machine: Machine, deviations: tuple[Deviation, ...]
) -> Imperfections:
    """Return the instruments' imperfections with those deviations that act on them."""
    for item in check(machine, deviations):
        if item.cause.alter_imperfections is not None:
            hook = item.cause.alter_imperfections
            imperfections = hook(imperfections, machine, item.location, item.theta)
    return imperfections


def alter_recording(
    recording: Recording,
    machine: Machine,
    deviations: tuple[Deviation, ...],
    rng: np.random.Generator,
) -> Recording:
    """Return the finished recording with those deviations that act on it."""
    for item in check(machine, deviations):
        if item.cause.alter_recording is not None:
            hook = item.cause.alter_recording
            recording = hook(recording, machine, item.location, item.theta, rng)
    return recording
