"""What a sensor sees in a network of bodies: the probe, and by what its value is multiplied."""

from escalator_twin.errors import MachineError
from escalator_twin.machine import Sensor
from escalator_twin.machine.multibody import MultibodyMachine
from escalator_twin.physics.multibody import loop
from escalator_twin.physics.multibody.guide import HANDRAIL_SEGMENTS
from escalator_twin.physics.multibody.layout import Layout

Probe = tuple[int, int, int]
ROLLERS = ('chain', 'trailing')
AXES = {'x': loop.ACCEL_X, 'z': loop.ACCEL_Z}
ON_STEPS = (
    'link_force', 'roller_reaction', 'carriage_displacement', 'step_acceleration', 'step_speed',
    'gear_torque', 'gear_motor_torque',
)  # fmt: skip
ON_HANDRAIL = (
    'handrail_tension', 'handrail_speed', 'handrail_torque', 'handrail_motor_torque'
)  # fmt: skip


def probe_of(sensor: Sensor, machine: MultibodyMachine, layout: Layout) -> tuple[Probe, float]:
    """Return the probe (kind, index, sub-index) of a sensor and its factor.

    Raises
    ------
    MachineError
        Where the quantity is unknown or its place is not in the machine.
    """
    at, quantity = sensor.at, sensor.quantity

    def place(key: str, n: int) -> int:
        value = at.get(key)
        if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < n:
            raise MachineError(
                f'{sensor.channel}: at.{key}: expected 0 to {n - 1}, found {value!r}'
            )
        return value

    def choice(key: str, known: tuple[str, ...]) -> str:
        if at.get(key) not in known:
            raise MachineError(
                f'{sensor.channel}: at.{key}: expected one of {", ".join(known)}, '
                f'found {at.get(key)!r}'
            )
        return str(at[key])

    if quantity in ON_STEPS and layout.steps is not None:
        n = layout.steps.n
        if quantity == 'link_force':
            return (loop.LINK_TENSION, place('link', n), 0), 1.0
        if quantity == 'roller_reaction':
            row = ROLLERS.index(choice('roller', ROLLERS))
            return (loop.POINT_NORMAL, row * n + place('step', n), 0), 1.0
        if quantity == 'carriage_displacement':
            return (loop.PART_WAY, 0, 0), 1.0
        if quantity == 'step_acceleration':
            return (AXES[choice('axis', tuple(AXES))], n + place('step', n), 0), 1.0
        if quantity == 'step_speed':
            return (loop.BODY_SPEED, n + place('step', n), 0), 1.0
        return (loop.TORQUE, 0, 0), 1.0 if quantity == 'gear_torque' else machine.drive.gear_ratio
    if quantity in ON_HANDRAIL and layout.handrail is not None and machine.handrail is not None:
        if quantity in ('handrail_tension', 'handrail_speed'):
            rows = layout.network.point_rows[layout.first_rail_point]
            row = int(rows[0]) + HANDRAIL_SEGMENTS.index(choice('segment', HANDRAIL_SEGMENTS))
            kind = loop.TENSION_AT if quantity == 'handrail_tension' else loop.SPEED_AT
            return (kind, layout.first_rail_point, row), 1.0
        ratio = machine.handrail.gear_ratio
        rotor = len(layout.network.rotor) - 1
        return (loop.TORQUE, rotor, 0), 1.0 if quantity == 'handrail_torque' else ratio
    raise MachineError(
        f'{sensor.channel}: quantity: expected one of {", ".join(ON_STEPS + ON_HANDRAIL)} of a '
        f'part that runs, found {quantity!r}'
    )
