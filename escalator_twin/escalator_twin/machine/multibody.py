"""A machine of free planar bodies: steps, rollers and a handrail, after Kwon, Park and Park.

What a section of `linked` has and this kind has no use for is no key here: the contact law gives
stiffness and damping, and a planar model has no sides. Masses, weights and forces are those of
both sides together; stiffnesses of a link, and materials, are those of one.
"""

from dataclasses import dataclass, field
from math import pi, sin

from escalator_twin.errors import MachineError
from escalator_twin.machine.checks import check_instruments, SEAT_FIT
from escalator_twin.machine.linked import (
    Chain,
    DIRECTIONS,
    Drive,
    Guide,
    Lateral,
    Machine,
    Roller,
)


@dataclass(frozen=True, kw_only=True)
class RollerChain(Chain):
    """Chain rollers, one a step, joined by links; ``mass_per_pitch_kg`` is all that rides with one.

    That is chain, axle and chain rollers of one pitch, both sides.
    """

    racking_stiffness_n_m: float = field(init=False, default=0.0)
    racking_damping_n_s_m: float = field(init=False, default=0.0)


@dataclass(frozen=True, kw_only=True)
class FreeRoller(Roller):
    """A roller as a body of its own; the same tread for chain rollers and trailing rollers.

    The drag of its bearing and tread at a spin w, seen at the tread, is

        (rolling_resistance N (1 + friction_rise exp(-|w| r / friction_speed)) + seal_drag)
        tanh(w r / creep_speed) + viscous_drag w r
    """

    mass_kg: float  # of one roller with its bearing
    trailing_extra_kg: float  # what rides with a pair of trailing rollers beside them
    friction_rise: float = 0.0
    friction_speed_m_s: float = 1.0
    seal_drag_n: float = 0.0  # of one roller
    contact_stiffness_n_m: float = field(init=False, default=0.0)
    contact_damping_n_s_m: float = field(init=False, default=0.0)


@dataclass(frozen=True, kw_only=True)
class TwoRunGuide(Guide):
    """Passenger run as in `Guide`; the return run falls straight from the upper gear.

    Its angle is what the landings leave; it ends in an arc that leads level into the lower gear.
    Trailing rollers run on the same line but on the passenger run, where their rail is shifted
    back by the wheelbase so that treads stay level.
    """

    return_transition_radius_m: float
    tread_length_m: float = 0.0  # of a straight level walk between the landings


@dataclass(frozen=True, kw_only=True)
class GearDrive(Drive):
    """The upper gear at a given speed: seats one pitch apart, which engage along ``ramp_m``."""

    gear_ratio: float  # gear over motor speed, below 1
    flank_play_m: float
    start_up_s: float = 1.0  # from rest to speed
    settle_s: float = 3.0  # after that, until a record begins
    start_m: float = field(init=False, default=0.0)
    length_m: float = field(init=False, default=0.0)
    stiffness_n_m: float = field(init=False, default=0.0)
    damping_n_s_m: float = field(init=False, default=0.0)


@dataclass(frozen=True)
class Step:
    """A step: its axle carries the chain rollers, its trailing rollers run behind on the level."""

    mass_kg: float
    inertia_kg_m2: float
    wheelbase_m: float
    centre_behind_m: float  # of mass, behind the axle
    centre_below_m: float
    bush_stiffness_n_m: float  # of a connection to a pair of rollers, any direction
    bush_damping_n_s_m: float


@dataclass(frozen=True)
class Material:
    """One kind of contact, as eqs. (4) to (7) of the paper want it."""

    elastic_modulus_pa: float  # E of eq. (5)
    restitution: float
    friction: float
    normal_speed_m_s: float  # V_c of eq. (6)
    sliding_speed_m_s: float  # V_c of eq. (7)


@dataclass(frozen=True)
class Materials:
    """The kinds of contact of the step part."""

    tread: Material
    gear: Material


@dataclass(frozen=True)
class HandrailGuide:
    """Centre line of a handrail: passenger run, newels, and the drive in the return run."""

    newel_radius_m: float
    lower_landing_m: float
    upper_landing_m: float
    lower_transition_radius_m: float
    upper_transition_radius_m: float
    deflector_radius_m: float
    belt_tensioner_radius_m: float
    lower_tensioner_radius_m: float
    steeper_deg: float  # by which the deflector turns the return run beyond its incline
    pulley_wrap_deg: float
    clearance_m: float


@dataclass(frozen=True)
class Handrail:
    """A handrail of rigid bodies; masses, stiffnesses and forces are those of both together."""

    n_bodies: int
    speed_m_s: float  # at the step speed that ``experiment`` gives; else in proportion
    gear_ratio: float
    mass_per_m_kg: float
    axial_stiffness_n: float  # EA
    link_damping_n_s_m: float
    bending_stiffness_n_m2: float  # EI
    bending_drag_n_m: float  # moment against a change of the angle between two bodies
    bending_rate_rad_s: float  # at which that moment saturates
    pulley_radius_m: float
    tension_n: float  # mean over the loop at rest, set by the tensioners
    face_radius_m: float  # R_1 of its lip
    guide: HandrailGuide
    slide: Material  # on its guides
    roll: Material  # on the roller curves of the newels
    pulley: Material


@dataclass(frozen=True, kw_only=True)
class MultibodyMachine(Machine):
    """Steps and handrail of an escalator or moving walk as chains of free planar bodies."""

    chain: RollerChain
    roller: FreeRoller
    guide: TwoRunGuide
    drive: GearDrive
    lateral: Lateral = field(init=False, default=Lateral(0.0, 0.0))
    step: Step
    contact: Materials
    handrail: Handrail | None = None
    time_step_s: float = 1.0e-4


POSITIVE = (
    ('chain', ('pitch_m', 'mass_per_pitch_kg', 'link_stiffness_n_m')),
    ('roller', ('diameter_m', 'mass_kg', 'creep_speed_m_s', 'friction_speed_m_s')),
    ('guide', ('turnaround_radius_m', 'return_transition_radius_m')),
    ('drive', ('gear_ratio', 'ramp_m')),
    ('tensioner', ('mass_kg', 'stiffness_n_m')),
    ('step', ('mass_kg', 'inertia_kg_m2', 'wheelbase_m', 'bush_stiffness_n_m')),
)  # fmt: skip


def check_multibody(machine: MultibodyMachine) -> None:
    """Raise a MachineError where numbers contradict each other."""
    where, chain, drive = machine.source, machine.chain, machine.drive
    if chain.n_links < 4:
        raise MachineError(f'{where}.chain.n_links: expected at least 4, found {chain.n_links}')
    for group, keys in POSITIVE:
        for key in keys:
            value = getattr(getattr(machine, group), key)
            if not value > 0.0:
                raise MachineError(f'{where}.{group}.{key}: expected > 0, found {value!r}')
    if machine.experiment.direction not in DIRECTIONS:
        raise MachineError(
            f'{where}.experiment.direction: expected up or down, '
            f'found {machine.experiment.direction!r}'
        )
    if drive.kind != 'wheel' or drive.seats < 3:
        raise MachineError(
            f'{where}.drive: expected kind wheel with 3 seats or more, '
            f'found {drive.kind!r} with {drive.seats}'
        )
    radius = chain.pitch_m / (2.0 * sin(pi / drive.seats))
    if abs(machine.guide.turnaround_radius_m / radius - 1.0) > SEAT_FIT:
        raise MachineError(
            f'{where}.guide.turnaround_radius_m: a gear of {drive.seats} seats for a pitch of '
            f'{chain.pitch_m} m has a radius of {radius:.5f} m, found '
            f'{machine.guide.turnaround_radius_m} m'
        )
    if machine.step.wheelbase_m >= chain.pitch_m:
        raise MachineError(
            f'{where}.step.wheelbase_m: expected less than the pitch of {chain.pitch_m} m, '
            f'found {machine.step.wheelbase_m}'
        )
    check_instruments(machine)
