"""A machine of linked axles: frozen dataclasses that mirror the YAML, key by key."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from escalator_twin.errors import MachineError
from escalator_twin.signals import Experiment

DIRECTIONS = {'up': 1, 'down': -1}


@dataclass(frozen=True)
class Chain:
    """Two closed chains of long links, joined by axles."""

    n_links: int
    pitch_m: float
    track_gauge_m: float
    mass_per_pitch_kg: float
    link_stiffness_n_m: float
    link_damping_n_s_m: float
    racking_stiffness_n_m: float
    racking_damping_n_s_m: float


@dataclass(frozen=True)
class Roller:
    """One roller on its two-sided channel."""

    diameter_m: float
    contact_stiffness_n_m: float
    contact_damping_n_s_m: float
    rolling_resistance: float
    creep_speed_m_s: float
    viscous_drag_n_s_m: float


@dataclass(frozen=True)
class Guide:
    """Roller-centre path of the closed guide and its as-built deviation."""

    rise_m: float
    inclination_deg: float
    lower_landing_m: float
    lower_transition_radius_m: float
    upper_transition_radius_m: float
    upper_landing_m: float
    turnaround_radius_m: float
    channel_clearance_m: float
    landing_tol_m: float = 0.0
    survey_file: str | None = None
    survey_error_m: float = 0.0
    turnaround_profile: str = 'circular'
    transition_profile: str = 'circular'
    profile_pitch_m: float | None = None  # of the links that compensated curves are made for


@dataclass(frozen=True)
class Drive:
    """Linear drive: a rack whose dogs, one pitch apart, carry the axles along a stretch.

    Or a wheel: ``seats`` seats in the upper turnaround, at constant angular speed; the set speed
    is that of the seats, and ``start_m`` and ``length_m`` say nothing.
    """

    kind: str
    start_m: float
    length_m: float
    ramp_m: float
    stiffness_n_m: float
    damping_n_s_m: float
    speed_error: float = 0.07
    speed_wander: float = 0.0
    seats: int = 0


@dataclass(frozen=True)
class Tensioner:
    """The lower turnaround: a carriage on a spring, sliding horizontally."""

    mass_kg: float
    stiffness_n_m: float
    damping_n_s_m: float
    dry_friction_n: float = 0.0
    preload_tol: float = 0.0


@dataclass(frozen=True)
class Load:
    """Counterweights on the passenger run: weight only, no inertia."""

    from_m: float
    to_m: float
    ramp_m: float
    tol: float = 0.0


@dataclass(frozen=True)
class Lateral:
    """Lateral guidance of an axle."""

    stiffness_n_m: float
    damping_n_s_m: float


@dataclass(frozen=True)
class DefaultExperiment:
    """What a simulation runs where its case leaves something open."""

    speed_m_s: float
    direction: str
    load_kg: float
    preload_n: float


@dataclass(frozen=True)
class Logger:
    """A clock: largest offset and drift against the recorder's."""

    offset_s: float
    drift_ppm: float


@dataclass(frozen=True)
class Recorder:
    """What stamps all messages with one clock."""

    latency_s: float


@dataclass(frozen=True)
class ExperimentTopic:
    """Where a recording tells its settings."""

    topic: str
    type: str


@dataclass(frozen=True)
class Sensor:
    """One channel: what it is in the model and where it is in a bag.

    The channel's value in SI is ``sign * scale * mean(fields) + offset``.
    """

    instrument: str
    name: str
    quantity: str
    at: dict[str, object]
    unit: str
    topic: str
    type: str
    fields: tuple[str, ...]
    rate_hz: float
    logger: str = ''
    labels: dict[str, object] = field(default_factory=dict)
    scale: float = 1.0
    sign: float = 1.0
    offset: float = 0.0
    noise: float = 0.0
    resolution: float = 0.0
    zero: float = 0.0
    gain_tol: float = 0.0
    thermal_drift: float = 0.0
    rotation_tol_deg: float = 0.0
    bending: tuple[float, ...] = ()
    faces: tuple[float, ...] = ()

    @property
    def channel(self) -> str:
        """Name of the channel, ``<instrument>/<quantity>``."""
        return f'{self.instrument}/{self.name}'


@dataclass(frozen=True)
class Instruments:
    """All sensors, and the clocks that stamp them."""

    loggers: dict[str, Logger]
    recorder: Recorder
    sensors: tuple[Sensor, ...]
    experiment: ExperimentTopic | None = None
    simulated_only: tuple[Sensor, ...] = ()
    measured_namespace: str = '/measured'
    simulated_namespace: str = '/simulated'

    @property
    def reference_logger(self) -> str:
        """Return the logger whose clock is the reference: the one with the least offset."""
        return min(self.loggers, key=lambda name: self.loggers[name].offset_s)

    @property
    def travelling_logger(self) -> str:
        """Return the first logger beside the reference; empty where there is one clock."""
        return next((n for n in self.loggers if n != self.reference_logger), '')

    def channels_of(self, logger: str) -> frozenset[str]:
        """Return the channels that a logger stamps."""
        return frozenset(s.channel for s in self.sensors if s.logger == logger)

    def sensor(self, channel: str) -> Sensor:
        """Return the sensor of ``channel``; a MachineError names those that exist."""
        for sensor in self.sensors + self.simulated_only:
            if sensor.channel == channel:
                return sensor
        known = ', '.join(s.channel for s in self.sensors)
        raise MachineError(f'channel {channel!r}: unknown; expected one of {known}')

    def measured_topic(self, topic: str) -> str:
        """Return the topic of a recording that the description names ``topic``."""
        return topic if topic.startswith('/') else f'{self.measured_namespace}/{topic}'

    def simulated_topic(self, topic: str) -> str:
        """Return the topic on which the twin publishes what a recording has on ``topic``."""
        return f'{self.simulated_namespace}/{topic.lstrip("/")}'


@dataclass(frozen=True)
class Deviation:
    """A cause of contracts.md at a place and of a size, as part of a machine."""

    cause: str
    parameters: dict[str, object]
    location: dict[str, object] = field(default_factory=dict)


@dataclass(frozen=True)
class Machine:
    """One machine: mechanics, instruments and known deviations.

    ``source`` is the file, ``bases`` are those that it extends, nearest first, and ``tolerances`` maps the
    key path of every ``{value, tol}`` to its relative standard deviation; none is a key of the file.
    """

    schema: str
    name: str
    physics: str
    chain: Chain
    roller: Roller
    guide: Guide
    drive: Drive
    tensioner: Tensioner
    load: Load
    lateral: Lateral
    gravity_m_s2: float
    experiment: DefaultExperiment
    instruments: Instruments
    deviations: tuple[Deviation, ...] = ()
    provenance: dict[str, object] = field(default_factory=dict)  # of an extended machine
    source: Path | None = None
    bases: tuple[Path, ...] = ()
    tolerances: Mapping[str, float] = field(default_factory=dict)

    def default_experiment(self) -> Experiment:
        """Return what a simulation runs where its case leaves something open."""
        given = self.experiment
        return Experiment(
            given.speed_m_s,
            DIRECTIONS[given.direction],
            (given.load_kg,),
            given.preload_n,
            machine=self.name,
        )
