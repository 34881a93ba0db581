"""What can be set on the nodes: one frozen dataclass each, which checks itself."""

from dataclasses import dataclass, field, fields, replace
import math
from typing import Any

from escalator_twin.errors import EscalatorError
from escalator_twin.machine import DIRECTIONS, Machine
from escalator_twin.signals import Experiment

DEFAULT_MACHINE = 'config/machines/prototype.yaml'
UNSET = -1.0  # of a number that is left to the machine's description


class SettingsError(EscalatorError):
    """A parameter is wrong; the message gives its name, what is expected and what was found."""


def setting(
    default: Any,
    doc: str,
    low: float | None = None,
    high: float | None = None,
    is_live: bool = False,
) -> Any:
    """Describe one parameter.

    Parameters
    ----------
    default : str, bool, int or float
        Its type is the parameter's.
    doc : str
        One sentence.
    low, high : float, optional
        Limits, both included.
    is_live : bool
        Whether it may be changed while the node runs.
    """
    metadata = {'doc': doc, 'low': low, 'high': high, 'is_live': is_live}
    return field(default=default, metadata=metadata)


def check(name: str, value: Any, default: Any, low: float | None, high: float | None) -> Any:
    """Return ``value`` in the type of ``default``.

    Raises
    ------
    SettingsError
        Where it has another type or leaves its limits.
    """
    if isinstance(default, float) and type(value) is int:
        value = float(value)
    if type(value) is not type(default):
        raise SettingsError(f'{name}: expected {_kind(default)}, found {value!r}')
    if isinstance(value, float) and not math.isfinite(value):
        raise SettingsError(f'{name}: expected a finite number, found {value!r}')
    if low is not None and high is not None and not low <= value <= high:
        raise SettingsError(f'{name}: expected {low:g} to {high:g}, found {value!r}')
    return value


def _kind(default: Any) -> str:
    return {bool: 'true or false', int: 'a whole number', float: 'a number'}.get(
        type(default), 'text'
    )


@dataclass(frozen=True)
class Settings:
    """Base: every field is checked against its own description."""

    def __post_init__(self) -> None:
        for entry in fields(self):
            about = entry.metadata
            value = getattr(self, entry.name)
            value = check(entry.name, value, entry.default, about['low'], about['high'])
            object.__setattr__(self, entry.name, value)


@dataclass(frozen=True)
class ExperimentSettings(Settings):
    """An experiment, and the machine that gives what is left open of it."""

    machine: str = setting(DEFAULT_MACHINE, 'YAML file that describes the machine')
    speed: float = setting(UNSET, "speed, m/s; -1: the machine's default", UNSET, 10.0)
    direction: str = setting('', "up or down; empty: the machine's default")
    load: float = setting(UNSET, "load on every step, kg; -1: the machine's default", UNSET, 1e4)
    preload: float = setting(
        UNSET, "preload of the tensioner, N; -1: the machine's default", UNSET, 1e6
    )

    def __post_init__(self) -> None:
        """Check every field."""
        Settings.__post_init__(self)
        if self.direction not in ('', *DIRECTIONS):
            raise SettingsError(
                f'direction: expected {" or ".join(DIRECTIONS)}, found {self.direction!r}'
            )

    def is_given(self) -> bool:
        """Tell whether anything of the experiment is set."""
        return bool(self.direction) or max(self.speed, self.load, self.preload) > UNSET

    def experiment(self, machine: Machine) -> Experiment:
        """Return the experiment."""
        default = machine.default_experiment()
        return replace(
            default,
            set_speed_m_s=default.set_speed_m_s if self.speed == UNSET else self.speed,
            direction=DIRECTIONS[self.direction] if self.direction else default.direction,
            load_per_step_kg=default.load_per_step_kg if self.load == UNSET else (self.load,),
            preload_n=default.preload_n if self.preload == UNSET else self.preload,
        )


@dataclass(frozen=True)
class SimulatorSettings(ExperimentSettings):
    """Parameters of the simulator."""

    machine: str = setting(
        DEFAULT_MACHINE,
        'YAML file that describes the machine; another one holds from the next start',
        is_live=True,
    )
    real_time_factor: float = setting(
        1.0,
        'simulated over wall time; 0: as fast as possible',
        0.0,
        1000.0,
        is_live=True,
    )
    autostart: bool = setting(True, 'start an experiment when the node starts')
    start_s: float = setting(0.0, 'path coordinate of axle 0 at the start, m', 0.0, 1e4)
    epoch: float = setting(
        0.0, 'time in header stamps when an experiment starts, seconds since 1970', 0.0, 2**31 - 1
    )
    publish_clock: bool = setting(False, 'publish simulated time on /clock')
    markers: bool = setting(False, 'publish steps, links and carriage for RViz, at 20 Hz')
    frame_id: str = setting('escalator', 'frame of the markers: x towards the upper landing, z up')
    message_rate: float = setting(
        10000.0,
        'most messages per second where nobody tells how far he has heard; 0: no limit',
        0.0,
        1e6,
        is_live=True,
    )


@dataclass(frozen=True)
class ComparatorSettings(ExperimentSettings):
    """Parameters of the comparator; the experiment holds where no message tells it."""

    bag: str = setting(
        '', 'recording to replay: a rosbag2 directory or a file of it; empty: listen instead'
    )
    rate: float = setting(
        1.0, 'replayed over wall time; 0: as fast as the simulator can', 0.0, 1000.0
    )
    start_offset_s: float = setting(
        0.0, 'what of the recording is left out at its start, s', 0.0, 1e6
    )
    loop: bool = setting(False, 'replay again and again')
    window_s: float = setting(
        0.0, 'recording time between two comparisons, s; 0: one whole loop', 0.0, 1e5
    )
    keep_s: float = setting(
        1800.0, 'listening: recording time that is kept for the summary, s', 10.0, 1e5
    )
    timeout_s: float = setting(
        5.0, 'listening: silence after which the recording has ended, s', 0.5, 1e4
    )
    json: str = setting('', 'file to write the result to, as `compare --json` does')
    session: str = setting(
        '', 'directory to make for measured, simulated and results as a rosbag2 recording'
    )
    exit_at_end: bool = setting(False, 'end the process when the comparison is done')
