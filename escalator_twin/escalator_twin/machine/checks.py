"""What a machine of linked axles must fulfil beyond the types of its keys."""

from math import pi, sin

from escalator_twin.errors import MachineError
from escalator_twin.machine.linked import DIRECTIONS, Machine

DRIVE_KINDS = ('linear', 'wheel')
PROFILES = ('circular', 'compensated')
SEAT_FIT = 1e-3  # relative, of a wheel's radius to its chain
POSITIVE = (
    ('chain', 'pitch_m'),
    ('chain', 'mass_per_pitch_kg'),
    ('chain', 'link_stiffness_n_m'),
    ('roller', 'contact_stiffness_n_m'),
    ('roller', 'creep_speed_m_s'),
    ('guide', 'turnaround_radius_m'),
    ('drive', 'length_m'),
    ('drive', 'stiffness_n_m'),
    ('tensioner', 'mass_kg'),
    ('tensioner', 'stiffness_n_m'),
    ('lateral', 'stiffness_n_m'),
)


def _check_geometry(machine: Machine) -> None:
    """Raise a MachineError where guide, chain and drive do not fit one another."""
    where, guide, drive, pitch = (
        machine.source,
        machine.guide,
        machine.drive,
        machine.chain.pitch_m,
    )
    for key in ('turnaround_profile', 'transition_profile'):
        profile = getattr(guide, key)
        if profile not in PROFILES:
            raise MachineError(
                f'{where}.guide.{key}: expected one of {", ".join(PROFILES)}, found {profile!r}'
            )
        if profile == 'compensated' and not (guide.profile_pitch_m or 0.0) > 0.0:
            raise MachineError(
                f'{where}.guide.profile_pitch_m: expected > 0 for a compensated curve, '
                f'found {guide.profile_pitch_m!r}'
            )
    if drive.kind != 'wheel':
        return
    if drive.seats < 3:
        raise MachineError(f'{where}.drive.seats: expected at least 3, found {drive.seats}')
    radius = pitch / (2.0 * sin(pi / drive.seats))
    circular = guide.turnaround_profile == 'circular'
    if not circular or abs(guide.turnaround_radius_m / radius - 1.0) > SEAT_FIT:
        raise MachineError(
            f'{where}.guide.turnaround_radius_m: a wheel of {drive.seats} seats for links of '
            f'{pitch} m needs a circular turnaround of {radius:.5f} m, found '
            f'{guide.turnaround_profile}, {guide.turnaround_radius_m} m'
        )


def check_linked(machine: Machine) -> None:
    """Raise a MachineError where numbers contradict each other."""
    where = machine.source
    chain = machine.chain
    if chain.n_links < 4:
        raise MachineError(f'{where}.chain.n_links: expected at least 4, found {chain.n_links}')
    for group, key in POSITIVE:
        value = getattr(getattr(machine, group), key)
        if not value > 0.0:
            raise MachineError(f'{where}.{group}.{key}: expected > 0, found {value!r}')
    if machine.drive.kind not in DRIVE_KINDS:
        raise MachineError(
            f'{where}.drive.kind: expected one of {", ".join(DRIVE_KINDS)}, '
            f'found {machine.drive.kind!r}'
        )
    _check_geometry(machine)
    if machine.experiment.direction not in DIRECTIONS:
        raise MachineError(
            f'{where}.experiment.direction: expected up or down, '
            f'found {machine.experiment.direction!r}'
        )
    check_instruments(machine)


def check_instruments(machine: Machine) -> None:
    """Raise a MachineError where sensors contradict one another."""
    where = machine.source
    channels = [s.channel for s in machine.instruments.sensors]
    for channel in channels:
        if channels.count(channel) > 1:
            raise MachineError(f'{where}.instruments.sensors: {channel!r} is there twice')
    for sensor in machine.instruments.sensors:
        if sensor.logger not in machine.instruments.loggers:
            raise MachineError(
                f'{where}.instruments.sensors: {sensor.channel}: logger: expected one of '
                f'{", ".join(machine.instruments.loggers)}, found {sensor.logger!r}'
            )
        if not sensor.rate_hz > 0.0 or sensor.scale == 0.0 or not sensor.fields:
            raise MachineError(
                f'{where}.instruments.sensors: {sensor.channel}: expected rate_hz > 0, '
                f'scale not 0 and at least one field'
            )
