"""Values that travel through the core: signals, recordings, findings. No ROS, no files."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from escalator_twin.errors import ExperimentError, RecordingError

Floats = NDArray[np.float64]
Nanoseconds = NDArray[np.int64]


def read_only(values: ArrayLike, dtype: type = np.float64) -> NDArray[Any]:
    """Return a copy of ``values`` that nobody can change."""
    array: NDArray[Any] = np.array(values, dtype=dtype)
    array.setflags(write=False)
    return array


@dataclass(frozen=True, slots=True)
class Finding:
    """One observation on the quality of a recording (``quality`` in the JSON contract).

    ``noise`` is the repaired channel's noise, times a sound one's.
    """

    kind: str
    channel: str
    from_s: float
    to_s: float
    detail: str
    repaired: bool = False
    noise: float = 1.0


@dataclass(frozen=True, slots=True)
class Experiment:
    """What the operator set: the four factors of the experiment plan.

    Attributes
    ----------
    set_speed_m_s : float
        Speed set at the drive, > 0, m/s.
    direction : int
        +1 up (towards increasing path coordinate), -1 down.
    load_per_step_kg : tuple of float
        One value for all steps, or one per step, kg.
    preload_n : float
        Preload of the full tensioner station, N.
    """

    set_speed_m_s: float
    direction: int
    load_per_step_kg: tuple[float, ...]
    preload_n: float
    case_id: str = ''
    machine: str = ''
    notes: str = ''

    def __post_init__(self) -> None:
        if not 0.0 < self.set_speed_m_s < 10.0:
            raise ExperimentError(
                f'speed: expected a value in (0, 10) m/s, found {self.set_speed_m_s!r}'
            )
        if self.direction not in (-1, 1):
            raise ExperimentError(f'direction: expected +1 or -1, found {self.direction!r}')
        if not self.load_per_step_kg or min(self.load_per_step_kg) < 0.0:
            raise ExperimentError(
                f'load: expected one or more values >= 0 kg, found {self.load_per_step_kg!r}'
            )
        if not 0.0 <= self.preload_n < 1e6:
            raise ExperimentError(f'preload: expected 0 to 1e6 N, found {self.preload_n!r}')


@dataclass(frozen=True, slots=True)
class Signal:
    """One channel of a recording.

    Attributes
    ----------
    channel : str
        ``<instrument>/<quantity>``.
    unit : str
        SI unit of ``values``.
    stamp_ns : (n,) int64
        The logger's own clock.
    bag_ns : (n,) int64
        The recorder's clock.
    values : (n,) float64
        The channel in SI units.
    parts : (n, k) float64
        What ``values`` is the mean of, in the same unit: one column a message field.
    """

    channel: str
    unit: str
    stamp_ns: Nanoseconds
    bag_ns: Nanoseconds
    values: Floats
    parts: Floats

    def __post_init__(self) -> None:
        n = len(self.values)
        lengths = {len(self.stamp_ns), len(self.bag_ns), len(self.parts), n}
        if len(lengths) != 1:
            raise RecordingError(
                f'{self.channel}: expected stamps, bag times and values of one length, found '
                f'{len(self.stamp_ns)}, {len(self.bag_ns)}, {n}'
            )

    @property
    def rate_hz(self) -> float:
        """Median rate of the stamps, Hz; 0 where there are fewer than two samples."""
        if len(self.stamp_ns) < 2:
            return 0.0
        return 1e9 / float(np.median(np.diff(self.stamp_ns)))

    def only(self, kept: NDArray[np.bool_]) -> 'Signal':
        """Return the signal with some of its samples, (n,) bool, their values as they are."""
        return Signal(
            self.channel,
            self.unit,
            read_only(self.stamp_ns[kept], np.int64),
            read_only(self.bag_ns[kept], np.int64),
            read_only(self.values[kept]),
            read_only(self.parts[kept]),
        )


def make_signal(
    channel: str, unit: str, stamp_ns: ArrayLike, bag_ns: ArrayLike, parts: ArrayLike
) -> Signal:
    """Build a signal whose value is the mean of its parts, all arrays copied and read-only."""
    columns = np.asarray(parts, dtype=np.float64)
    if columns.ndim == 1:
        columns = columns[:, None]
    return Signal(
        channel,
        unit,
        read_only(stamp_ns, np.int64),
        read_only(bag_ns, np.int64),
        read_only(columns.mean(axis=1) if len(columns) else np.zeros(0)),
        read_only(columns),
    )


@dataclass(frozen=True, slots=True)
class Recording:
    """All channels of one run, measured or simulated.

    Attributes
    ----------
    path : str
        Where it was read from; empty for a simulation.
    signals : mapping from channel name to Signal
    experiment : Experiment or None
        The run's settings, ``None`` where the recording does not say.
    findings : tuple of Finding
        What reading alone showed.
    """

    path: str
    signals: Mapping[str, Signal]
    experiment: Experiment | None = None
    findings: tuple[Finding, ...] = field(default=())
