"""Where a cause may sit: the keys of a location and what a machine admits for each."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from escalator_twin.errors import MachineError
from escalator_twin.machine import Machine, MultibodyMachine
from escalator_twin.physics.course import course_of
from escalator_twin.physics.parameters import SIDES

Values = tuple[object, ...]
Location = Mapping[str, object]
BOTH = 'both'
LINK_FORCE = 'link_force'
AXES = ('x', 'y', 'z')


@dataclass(frozen=True)
class Place:
    """One key of a location.

    Attributes
    ----------
    key : str
    check : callable
        Takes a value and a machine, returns the value in its type or raises a MachineError.
    values : callable or None
        All admissible values of a machine; ``None`` where they cannot be listed.
    """

    key: str
    check: Callable[[object, Machine], object]
    values: Callable[[Machine], Values] | None = None


def _wrong(key: str, expected: str, found: object) -> MachineError:
    return MachineError(f'location.{key}: expected {expected}, found {found!r}')


def index(key: str) -> Place:
    """Return a place that counts links, axles or steps from 0."""

    def values(machine: Machine) -> Values:
        return tuple(range(machine.chain.n_links))

    def check(value: object, machine: Machine) -> object:
        last = machine.chain.n_links - 1
        if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= last:
            raise _wrong(key, f'a whole number from 0 to {last}', value)
        return value

    return Place(key, check, values)


def choice(key: str, options: Callable[[Machine], Values]) -> Place:
    """Return a place that is one of a few names or numbers."""

    def check(value: object, machine: Machine) -> object:
        known = options(machine)
        if value not in known or isinstance(value, bool):
            raise _wrong(key, 'one of ' + ', '.join(map(str, known)), value)
        return value

    return Place(key, check, options)


def several(key: str, options: Callable[[Machine], Values], least: int = 1) -> Place:
    """Return a place that is a list of different names or numbers."""

    def check(value: object, machine: Machine) -> object:
        known = options(machine)
        items = tuple(value) if isinstance(value, list | tuple) else ()
        if len(items) < least or len(set(map(str, items))) < len(items):
            raise _wrong(key, f'a list of {least} or more different ones', value)
        for item in items:
            if item not in known or isinstance(item, bool):
                raise _wrong(key, 'only items of ' + ', '.join(map(str, known)), item)
        return items

    return Place(key, check)


def coordinate(key: str) -> Place:
    """Return a place that is a path coordinate, m, on the design path."""

    def check(value: object, machine: Machine) -> object:
        length = course_of(machine).length_m
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise _wrong(key, f'a number from 0 to {length:.4f} m', value)
        if not 0.0 <= value <= length:
            raise _wrong(key, f'a number from 0 to {length:.4f} m', value)
        return float(value)

    return Place(key, check)


def steps_of(machine: Machine) -> Values:
    """Return the numbers of a machine's steps."""
    return tuple(range(machine.chain.n_links))


def sides_of(machine: Machine) -> Values:
    """Return the sides of one roller or link; a planar machine cannot tell them: both, too."""
    return (*SIDES, BOTH) if isinstance(machine, MultibodyMachine) else SIDES


def instrumented_links(machine: Machine) -> Values:
    """Return the names of the sensors of link force."""
    return tuple(s.name for s in machine.instruments.sensors if s.quantity == LINK_FORCE)


def channels_of(machine: Machine) -> Values:
    """Return the channels, and before them the short names of the instrumented links."""
    return instrumented_links(machine) + tuple(s.channel for s in machine.instruments.sensors)


def fields_of(machine: Machine) -> Values:
    """Return the numbers of the gauges of an instrumented link, from 1."""
    most = max(
        (len(s.fields) for s in machine.instruments.sensors if s.quantity == LINK_FORCE), default=0
    )
    return tuple(range(1, most + 1))


LINK = index('link')
AXLE = index('axle')
STEP = index('step')
SIDE = choice('side', sides_of)
SIDE_OR_BOTH = choice('side', lambda _: (*SIDES, BOTH))
STEPS = several('steps', steps_of)
LANDING = choice('which', lambda _: ('upper',))
S = coordinate('s_m')
S_FROM = coordinate('s_from_m')
S_TO = coordinate('s_to_m')
GAUGED_LINK = choice('link', instrumented_links)
GAUGED_LINKS = several('links', instrumented_links)
GAUGE = choice('gauge', fields_of)
AXIS = choice('axis', lambda _: AXES)
CHANNEL = choice('channel', channels_of)
CHANNELS = several('channels', channels_of)
TWO_CHANNELS = several('channels', channels_of, least=2)


def find_channel(machine: Machine, name: str) -> str:
    """Return the channel of a name: a channel, or an instrumented link's short name."""
    for sensor in machine.instruments.sensors:
        if sensor.channel == name:
            return name
    for sensor in machine.instruments.sensors:
        if sensor.quantity == LINK_FORCE and sensor.name == name:
            return sensor.channel
    raise _wrong('channel', 'one of ' + ', '.join(map(str, channels_of(machine))), name)


def integer(location: Location, key: str) -> int:
    """Return a checked location's whole number."""
    value = location[key]
    assert isinstance(value, int)
    return value


def number(location: Location, key: str) -> float:
    """Return a checked location's number."""
    value = location[key]
    assert isinstance(value, float)
    return value


def text(location: Location, key: str) -> str:
    """Return a checked location's name."""
    value = location[key]
    assert isinstance(value, str)
    return value


def items(location: Location, key: str) -> tuple[object, ...]:
    """Return a checked location's list."""
    value = location[key]
    assert isinstance(value, tuple)
    return value
