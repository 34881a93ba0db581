"""What a cause is: one thing that may be wrong with a machine or with its measurement."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import product
from math import inf

import numpy as np

from escalator_twin.causes.imperfections import Imperfections
from escalator_twin.causes.places import Location, Place
from escalator_twin.errors import MachineError
from escalator_twin.machine import Machine, MultibodyMachine
from escalator_twin.physics.multibody.layout import Layout
from escalator_twin.physics.parameters import Parameters
from escalator_twin.signals import Recording

Theta = Mapping[str, float]

AlterMachine = Callable[[Machine, Location, Theta], Machine]
AlterParameters = Callable[[Parameters, Machine, Location, Theta], Parameters]
AlterLayout = Callable[[Layout, MultibodyMachine, Location, Theta], Layout]
AlterImperfections = Callable[[Imperfections, Machine, Location, Theta], Imperfections]
AlterRecording = Callable[[Recording, Machine, Location, Theta, np.random.Generator], Recording]

__all__ = ['CONTRACT', 'Cause', 'Location', 'Parameter', 'Theta']

CONTRACT = 'contracts.md, table of causes'
HOOKS = ('alter_machine', 'alter_parameters', 'alter_imperfections', 'alter_recording')


@dataclass(frozen=True)
class Parameter:
    """One number of a cause.

    Attributes
    ----------
    name : str
        The key in a deviation, its unit in the name.
    unit : str
        ``'-'`` where there is none.
    low, high : float
        What is admitted, ends included.
    neutral : float or None
        The value at which the cause is absent; ``None`` for a number that shapes the effect
        and does not size it.
    tolerance : float or None
        What a good machine may have, one standard deviation; ``None`` where there is none.
    default : float or None
        Taken where a deviation leaves the parameter out; ``None``: it must be given.
    """

    name: str
    unit: str
    low: float
    high: float
    neutral: float | None = None
    tolerance: float | None = None
    default: float | None = None

    def __post_init__(self) -> None:
        for value in (self.neutral, self.default):
            if value is not None and not self.low <= value <= self.high:
                raise ValueError(f'{self.name}: {value} is not in {self.low} to {self.high}')

    def check(self, value: object) -> float:
        """Return ``value`` as a number; a MachineError says what was expected."""
        expected = f'a number from {self.low:g} to {self.high:g} {self.unit}'
        if isinstance(value, bool) or not isinstance(value, int | float | str):
            raise MachineError(f'{self.name}: expected {expected}, found {value!r}')
        try:  # YAML 1.1 reads 1e-3 as text
            number = float(value)
        except ValueError:
            number = inf
        if not self.low <= number <= self.high:
            raise MachineError(f'{self.name}: expected {expected}, found {value!r}')
        return number


@dataclass(frozen=True)
class Cause:
    """One cause, its law in the module that defines it.

    Attributes
    ----------
    name : str
        As in contracts.md.
    law : str
        The law in one line.
    parameters : tuple of Parameter
    places : tuple of Place
        Keys of its location.
    references : tuple of mapping
        Sizes at which it is to be found; empty where it has no size.
    acts_on : tuple of str
        Quantities of sensors that it changes.
    locked_to : tuple of str
        What its effect repeats with: ``guide`` (place), ``link`` (identity), ``travel``,
        ``time``, ``load``, ``side`` or ``sample``.
    alike : tuple of str
        Causes from which it may not be told apart, and under what condition the module says.
    source : str
    alter_layout : callable, optional
        The law for machines of free bodies, where another one does not serve them.
    free_bodies : bool
        Whether ``alter_machine`` serves machines of free bodies too.
    """

    name: str
    law: str
    parameters: tuple[Parameter, ...]
    places: tuple[Place, ...]
    references: tuple[Theta, ...]
    acts_on: tuple[str, ...]
    locked_to: tuple[str, ...]
    alike: tuple[str, ...] = ()
    source: str = CONTRACT
    alter_machine: AlterMachine | None = None
    alter_parameters: AlterParameters | None = None
    alter_imperfections: AlterImperfections | None = None
    alter_recording: AlterRecording | None = None
    alter_layout: AlterLayout | None = None
    free_bodies: bool = False

    def __post_init__(self) -> None:
        hooks = [name for name in HOOKS if getattr(self, name) is not None]
        # a law of numbers may be told for either kind of machine, or for free bodies alone
        if len(hooks) != 1 and (hooks or self.alter_layout is None):
            raise ValueError(f'{self.name}: expected one hook, found {hooks}')

    @property
    def of_machine(self) -> bool:
        """Whether the machine is wrong, and not its measurement."""
        hooks = self.alter_machine, self.alter_parameters, self.alter_layout
        return any(hook is not None for hook in hooks)

    def acts_in(self, machine: Machine) -> bool:
        """Whether the cause has a law for machines of this kind."""
        if not self.of_machine:
            return True
        if isinstance(machine, MultibodyMachine):
            return self.alter_layout is not None or self.free_bodies
        return self.alter_machine is not None or self.alter_parameters is not None

    @property
    def sizes(self) -> tuple[Parameter, ...]:
        """Parameters that size the effect; all others shape it."""
        return tuple(p for p in self.parameters if p.neutral is not None)

    def neutral(self) -> dict[str, float]:
        """Return parameters with which the cause is absent."""
        shape = self.references[0] if self.references else {}
        values = {}
        for p in self.parameters:
            value = p.neutral if p.neutral is not None else shape.get(p.name, p.default)
            values[p.name] = p.low if value is None else value
        return values

    def complete(self, parameters: Mapping[str, object]) -> dict[str, float]:
        """Return all parameters as numbers, defaults filled in.

        Raises
        ------
        MachineError
            On a parameter that is unknown, missing or out of its bounds.
        """
        names = ', '.join(p.name for p in self.parameters) or 'none'
        for key in parameters:
            if key not in {p.name for p in self.parameters}:
                raise MachineError(f'parameters.{key}: unknown; expected {names}')
        values = {}
        for p in self.parameters:
            given = parameters.get(p.name, p.default)
            if given is None:
                raise MachineError(f'parameters.{p.name}: missing; expected {names}')
            try:
                values[p.name] = p.check(given)
            except MachineError as error:
                raise MachineError(f'parameters.{error}') from None
        return values

    def locate(self, location: Location, machine: Machine) -> dict[str, object]:
        """Return the location with defaults filled in.

        Raises
        ------
        MachineError
            On a key that is unknown or missing, or a place that the machine does not have.
        """
        keys = ', '.join(place.key for place in self.places) or 'none'
        for key in location:
            if key not in {place.key for place in self.places}:
                raise MachineError(f'location.{key}: unknown; expected {keys}')
        values: dict[str, object] = {}
        for place in self.places:
            if place.key not in location:
                raise MachineError(f'location.{place.key}: missing; expected {keys}')
            values[place.key] = place.check(location[place.key], machine)
        return values

    def candidates(self, machine: Machine) -> list[dict[str, object]]:
        """Return all combinations of the places that can be listed.

        Path coordinates and lists of steps cannot: their keys are left out.
        """
        listed = [p for p in self.places if p.values is not None]
        options = [p.values(machine) for p in listed if p.values is not None]
        return [
            dict(zip((p.key for p in listed), chosen, strict=True)) for chosen in product(*options)
        ]
