"""The grid along travel on which measured and simulated loops are compared, and its band."""

from dataclasses import dataclass

import numpy as np
from scipy import fft

from escalator_twin.machine import Machine
from escalator_twin.signals import Floats

BAND_HZ = 20.0  # of everything that diagnosis looks at
GRID_HZ = 50.0  # of the grids along travel, at the real speed
RATE_HZ = 200.0  # of simulated records
FILTER_ORDER = 4


@dataclass(frozen=True)
class Frame:
    """The grid along travel that all signals of one experiment share.

    Attributes
    ----------
    pitch_m : float
    n_links : int
    per_pitch : int
        Grid points in a pitch of travel.
    speed_m_s : float
        At which the grid is passed.
    """

    pitch_m: float
    n_links: int
    per_pitch: int
    speed_m_s: float

    @classmethod
    def of(cls, machine: Machine, speed_m_s: float) -> 'Frame':
        """Return the grid that is passed at about ``GRID_HZ``."""
        pitch = machine.chain.pitch_m
        count = max(4, round(pitch * GRID_HZ / speed_m_s))
        return cls(pitch, machine.chain.n_links, count, speed_m_s)

    @property
    def spacing_m(self) -> float:
        """Spacing of the grid, m."""
        return self.pitch_m / self.per_pitch

    @property
    def n_loop(self) -> int:
        """Grid points in a loop."""
        return self.per_pitch * self.n_links

    @property
    def rate_hz(self) -> float:
        """Rate at which the grid is passed, Hz."""
        return self.speed_m_s / self.spacing_m


@dataclass(frozen=True)
class Loop:
    """Recorded columns over one loop of travel, from path coordinate 0 of axle 0.

    Attributes
    ----------
    columns : (n_loop, k) float32
    place_m : (n_loop,) float64
        Path coordinate of axle 0, unwrapped.
    length_m : float
        Of the path, signed as travel.
    rack_m : float
        Travel of the rack, positive as it moves, less travel of the loop; but for whole pitches.
    rolled_m : (n_loop + 1,) float64 or None
        Way that axle 0's rollers have rolled since the run's first sample, signed as travel, also one
        point past the loop: in it more than the path is long by twice the carriage's displacement,
        and by how far from the path's middle they roll through the curves. None where columns of
        everything are not asked for, or one pitch stands for the loop.
    """

    columns: np.ndarray
    place_m: Floats
    length_m: float
    rack_m: float
    rolled_m: Floats | None = None


@dataclass(frozen=True)
class Begin:
    """Where a loop's travel is counted from: at some travel, axle 0 stands at a place.

    A recording's run begins with axle 0 at a place. A machine with a longer landing, a longer chain or a
    carriage that stands elsewhere comes there some millimetres of travel sooner or later.

    Attributes
    ----------
    place_m : float
        Path coordinate of axle 0.
    travel_m : float
    """

    place_m: float
    travel_m: float


Origin = float | Begin | None  # the rack at no travel, an axle's place, or path coordinate 0


def rack_shift(rack_m: float, reference_m: float, pitch_m: float) -> float:
    """Return by how much travel must be shifted for two runs to have their dogs alike, m.

    A run is begun with axle 0 at a place, which a longer chain or a carriage that stands elsewhere
    moves against the rack; what all machines share is the rack, whose travel is counted in pitches.
    """
    return (rack_m - reference_m + 0.5 * pitch_m) % pitch_m - 0.5 * pitch_m


def shift_of(
    origin: Origin,
    rack_m: float,
    travel_m: Floats,
    place_m: Floats,
    length_m: float,
    pitch_m: float,
) -> float:
    """Return what is to be added to a loop's travel for it to be counted from an origin, m.

    ``place_m`` is the path coordinate of axle 0, unwrapped, at ``travel_m``.
    """
    if origin is None:
        return 0.0
    if isinstance(origin, Begin):
        direction = np.sign(place_m[-1] - place_m[0])
        way = direction * place_m
        target = way[0] + (direction * origin.place_m - way[0]) % length_m
        here = float(np.interp(target, way, travel_m))
        return rack_shift(origin.travel_m, here, pitch_m)
    return rack_shift(rack_m, origin, pitch_m)


def band_limited(values: np.ndarray, rate_hz: float) -> np.ndarray:
    """Return columns (n, k) behind a zero-phase low-pass of ``BAND_HZ``.

    The magnitude is that of a Butterworth filter of order 4 run forwards and backwards; the ends
    are continued, mirrored in their end points.
    """
    n = len(values)
    pad = min(n - 1, round(4.0 * rate_hz / BAND_HZ))
    head = 2.0 * values[0] - values[pad:0:-1]
    tail = 2.0 * values[-1] - values[-2 : -pad - 2 : -1]
    whole = np.concatenate([head, values, tail])
    # a straight line from end to end goes round the seam of the transform unharmed
    line = np.linspace(0.0, 1.0, len(whole), dtype=values.dtype)[:, None]
    line = line * (whole[-1] - whole[0]) + whole[0]
    size = fft.next_fast_len(len(whole), real=True)
    spectrum = fft.rfft(whole - line, size, axis=0)
    frequency = np.fft.rfftfreq(size, 1.0 / rate_hz)
    gain = 1.0 / (1.0 + (frequency / BAND_HZ) ** (2 * FILTER_ORDER))
    spectrum *= gain.astype(values.dtype)[:, None]
    smooth: np.ndarray = fft.irfft(spectrum, size, axis=0)[: len(whole)] + line
    return smooth[pad : pad + n]
