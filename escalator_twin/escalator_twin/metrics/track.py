"""Where in the loop every sample of a recording was taken; shared by all its channels."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from escalator_twin.errors import SynchronisationError
from escalator_twin.metrics.filters import Places, places_at, thinning
from escalator_twin.signals import Floats

LOW_HZ = 2.0  # low-pass of the comparison, Cano-Moreno et al., section V
BAND_HZ = 20.0  # low-pass of the ripple scores
MARGIN_S = 2.0  # left out at each end of a recording
RIPPLE_FROM = 0.5  # cycles per pitch: slower is trend, faster is ripple
PLACES_PER_PITCH = 32.0  # at which two passages are compared
BAND_SAMPLES = 4.0  # per period of BAND_HZ that the thinned signals keep
MULTIPLES = (1.0, 2.0, 3.0, 4.0)  # cycles per pitch


@dataclass(frozen=True)
class Track:
    """One recording's uniform time grid with the travel at each sample.

    Attributes
    ----------
    travel_m : (n,) float64
        Path travel since the first sample, m, never falling, whatever the direction.
    rate_hz : float
        Rate of the grid, Hz.
    loop_m : float
        Travel after which a signal locked to the machine repeats, m: links times pitch.
    pitch_m : float
        Chain pitch, m.
    orders : tuple of float
        Orders of the machine, cycles per pitch; `machine_orders` gives them.
    """

    travel_m: Floats
    rate_hz: float
    loop_m: float
    pitch_m: float
    orders: tuple[float, ...] = MULTIPLES

    def __post_init__(self) -> None:
        for name in ('rate_hz', 'loop_m', 'pitch_m'):
            value = getattr(self, name)
            if not 0.0 < value < np.inf:
                raise SynchronisationError(f'{name}: expected > 0, found {value!r}')
        if self.travel_m.ndim != 1 or not np.isfinite(self.travel_m).all():
            raise SynchronisationError('travel_m: expected one row of finite values')
        if len(self.travel_m) > 1 and float(np.diff(self.travel_m).min()) < 0.0:
            raise SynchronisationError('travel_m: expected never to fall')

    @property
    def speed_m_s(self) -> float:
        """Mean rate of travel, m/s; 0 for fewer than two samples."""
        n = len(self.travel_m)
        if n < 2:
            return 0.0
        return float(self.travel_m[-1] - self.travel_m[0]) * self.rate_hz / (n - 1)

    @cached_property
    def inside(self) -> slice:
        """Samples at least 2 s from both ends."""
        margin = int(np.ceil(MARGIN_S * self.rate_hz - 1e-9))
        return slice(margin, max(margin, len(self.travel_m) - margin))

    @cached_property
    def n_loops(self) -> int:
        """Whole loops that fit inside; the first begins at the first sample inside."""
        x = self.travel_m[self.inside]
        if len(x) < 2:
            return 0
        # the last sample stands for its own step of travel too
        return int((2.0 * x[-1] - x[-2] - x[0]) / self.loop_m + 1e-9)

    @cached_property
    def kept(self) -> slice:
        """Samples that are scored: all whole loops inside, or all inside where there is none.

        The loops follow each other without a gap from the first sample inside.
        """
        inside = self.inside
        if self.n_loops == 0:
            return inside
        x = self.travel_m[inside]
        n = int(np.searchsorted(x, x[0] + self.n_loops * self.loop_m * (1.0 - 1e-12)))
        return slice(inside.start, inside.start + n)

    @cached_property
    def step(self) -> int:
        """Every so many samples of the 20 Hz band are enough: four per period."""
        return thinning(self.rate_hz, BAND_SAMPLES * BAND_HZ)

    @cached_property
    def kept_thin(self) -> slice:
        """The samples of `kept` on the grid thinned by `step`."""
        return thin_slice(self.kept, self.step)

    @property
    def ripple_hz(self) -> float:
        """Half a cycle per pitch at the mean speed, Hz."""
        return RIPPLE_FROM * self.speed_m_s / self.pitch_m

    @cached_property
    def passed_twice(self) -> float:
        """Share of a loop that was passed at least twice inside, 0 to 1."""
        x = self.travel_m[self.inside]
        if len(x) < 2:
            return 0.0
        return float(np.clip((x[-1] - x[0] - self.loop_m) / self.loop_m, 0.0, 1.0))

    @cached_property
    def passages(self) -> tuple[NDArray[np.int64], Floats]:
        """Pairs of samples one loop apart, on the grid thinned by `step`.

        Returns
        -------
        first : (k,) int64
            Samples that are passed again inside, at least a 32nd of a pitch apart.
        second : (k,) float64
            Fractional index at which the same place is passed one loop later.
        """
        inside = thin_slice(self.inside, self.step)
        x = self.travel_m[:: self.step]
        here = x[inside]
        if len(here) < 2 or len(x) < 4:  # a cubic needs four
            return np.zeros(0, dtype=np.int64), np.zeros(0)
        n = int(np.searchsorted(here, here[-1] - self.loop_m, side='right'))
        spacing = (here[-1] - here[0]) / (len(here) - 1)
        stride = thinning(self.pitch_m / PLACES_PER_PITCH, spacing) if spacing > 0.0 else 1
        first = np.arange(0, n, stride)
        index = np.arange(len(here), dtype=np.float64)
        second = np.interp(here[first] + self.loop_m, here, index)
        return inside.start + first, inside.start + second

    @cached_property
    def second_places(self) -> Places:
        """The second of `passages` in a thinned row, with what interpolation needs there."""
        count = -(-len(self.travel_m) // self.step)
        return places_at(self.passages[1], count)

    @cached_property
    def order_step(self) -> int:
        """Every so many samples are enough for the orders: aliases fall outside the band."""
        fastest = max((k for k in self.orders), default=0.0) * self.speed_m_s / self.pitch_m
        band = self.rate_hz / self.step
        return self.step * thinning(band, 2.0 * BAND_HZ + fastest)

    @cached_property
    def phasors(self) -> NDArray[np.complex128]:
        """Turning back each order: exp(-2 pi i k travel / pitch), (orders, samples kept)."""
        kept = thin_slice(self.kept, self.order_step)
        cycles = self.travel_m[:: self.order_step][kept] / self.pitch_m
        return np.exp(-2j * np.pi * np.outer(self.orders, cycles))

    @cached_property
    def hann(self) -> Floats:
        """Hann window over the samples of `phasors`, of mean 2: it gives amplitudes back."""
        n = self.phasors.shape[1]
        return (2.0 / max(n, 1)) * (1.0 - np.cos(2.0 * np.pi / max(n, 1) * np.arange(n)))


def thin_slice(full: slice, step: int) -> slice:
    """Return which of every ``step``-th sample lie in the slice ``full``."""
    return slice(-(-full.start // step), -(-full.stop // step))


def machine_orders(
    n_links: int, pitch_m: float, roller_diameter_m: float | None = None
) -> tuple[float, ...]:
    """Return the orders of a chain machine, cycles per pitch.

    Once per loop, once to four times per pitch, and once per turn of a roller
    that rolls on its tread: pitch / (pi diameter).
    """
    orders = (1.0 / n_links, *MULTIPLES)
    if roller_diameter_m is None:
        return orders
    return (*orders, pitch_m / (np.pi * roller_diameter_m))
