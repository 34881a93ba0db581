"""One channel, measured and simulated, in the bands that the metrics look at."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from escalator_twin.errors import SynchronisationError
from escalator_twin.metrics.agreement import Products, products
from escalator_twin.metrics.filters import (
    bridge,
    centred,
    highpass,
    lowpass,
    Mask,
    thinning,
)
from escalator_twin.metrics.track import BAND_HZ, LOW_HZ, Track
from escalator_twin.signals import Floats

SLOW_HZ = 0.2  # second cut-off for accelerations, Cano-Moreno et al., section V.B
SLOW_SAMPLES = 100.0  # per period of SLOW_HZ that the 2 Hz signal keeps for it


class _Rows(NamedTuple):
    measured: Floats
    simulated: Floats


class Pair(_Rows):
    """A measured and a simulated array of one shape and unit."""

    @cached_property
    def products(self) -> Products:
        """What point-by-point scores of the two are made of."""
        return products(*self)


@dataclass(frozen=True)
class Bands:
    """A pair of signals on a track, in bands.

    Build it with `split_bands`. Means are removed. Where ``valid`` is false both signals are
    bridged by straight lines between the same samples, so that what a filter makes of
    a gap is the same in both; the bridge itself is in no score taken sample by sample.

    Attributes
    ----------
    track : Track
    low : Pair of (n,) float64
        Below 2 Hz, all n samples, the channel's unit.
    band : Pair of (n / track.step,) float64
        Below 20 Hz, every ``track.step``-th sample.
    valid : (n,) bool
    mean : tuple of float
        The means that were removed, measured and simulated.
    """

    track: Track
    low: Pair
    band: Pair
    valid: Mask
    mean: tuple[float, float]

    @cached_property
    def ripple(self) -> Pair:
        """`band` without what is slower than half a cycle per pitch.

        The high-pass runs in time, at the frequency that half a cycle per pitch has at the
        mean speed: as good as in travel while the speed keeps within a few percent.
        """
        cut, rate = self.track.ripple_hz, self.track.rate_hz / self.track.step
        band = self.band
        return Pair(highpass(band.measured, cut, rate), highpass(band.simulated, cut, rate))

    @cached_property
    def slow(self) -> Pair:
        """Samples kept of the signals below 0.2 Hz, on a thinned grid."""
        step = thinning(self.track.rate_hz, SLOW_SAMPLES * SLOW_HZ)
        rate, kept = self.track.rate_hz / step, self.track.kept
        rows = [lowpass(row[::step].copy(), SLOW_HZ, rate) for row in self.low]
        chosen = slice(-(-kept.start // step), -(-kept.stop // step))
        return self._valid(Pair(*rows), chosen, step)

    @cached_property
    def low_kept(self) -> Pair:
        """Samples of `low` that are scored."""
        return self._valid(self.low, self.track.kept, 1)

    @cached_property
    def band_kept(self) -> Pair:
        """Samples of `band` that are scored."""
        return self._valid(self.band, self.track.kept_thin, self.track.step)

    @cached_property
    def ripple_kept(self) -> Pair:
        """Samples of `ripple` that are scored."""
        return self._valid(self.ripple, self.track.kept_thin, self.track.step)

    @cached_property
    def trend_kept(self) -> Pair:
        """What `band_kept` has below half a cycle per pitch."""
        return _less(self.band_kept, self.ripple_kept)

    @cached_property
    def low_twice(self) -> Pair:
        """`low` of the measurement at the same places, one loop apart."""
        return self._twice(self.low.measured[:: self.track.step])

    @cached_property
    def ripple_twice(self) -> Pair:
        """`ripple` of the measurement at the same places, one loop apart."""
        return self._twice(self.ripple.measured)

    @cached_property
    def trend_twice(self) -> Pair:
        """The trend of the measurement at the same places, one loop apart."""
        return _less(self._twice(self.band.measured), self.ripple_twice)

    def _twice(self, thin: Floats) -> Pair:
        """Return ``thin``, every ``track.step``-th sample, at the track's pairs of passages."""
        first, second = self.track.passages
        valid = self.valid[:: self.track.step]
        real = valid[first] & valid[np.rint(second).astype(np.int64)]
        again = self.track.second_places.of(thin)
        if real.all():
            return Pair(thin[first], again)
        return Pair(thin[first[real]], again[real])

    def _valid(self, pair: Pair, kept: slice, step: int) -> Pair:
        """Return the samples of ``pair`` in ``kept`` that are real."""
        valid = self.valid[::step][kept]
        if valid.all():
            return Pair(pair.measured[kept], pair.simulated[kept])
        return Pair(pair.measured[kept][valid], pair.simulated[kept][valid])


def split_bands(
    measured: Floats, simulated: Floats, track: Track, valid: Mask | None = None
) -> Bands:
    """Prepare one channel for scoring.

    Parameters
    ----------
    measured, simulated : (n,) float64
        The channel on the track's grid, its own unit; NaN where there is no sample.
    track : Track
        Where each sample was taken.
    valid : (n,) bool, optional
        False for samples that shall not count: gaps, spikes.

    Raises
    ------
    SynchronisationError
        Where the lengths differ.
    """
    n = len(track.travel_m)
    for name, row in (('measured', measured), ('simulated', simulated), ('valid', valid)):
        if row is not None and len(row) != n:
            raise SynchronisationError(f'{name}: expected {n} samples, found {len(row)}')
    real = np.isfinite(measured) & np.isfinite(simulated)
    if valid is not None:
        real &= valid
    rows = [_filtered(row, real, track) for row in (measured, simulated)]
    low, band, mean = zip(*rows, strict=True)
    return Bands(track, Pair(*low), Pair(*band), real, (mean[0], mean[1]))


def _filtered(row: Floats, real: Mask, track: Track) -> tuple[Floats, Floats, float]:
    """Return one signal below 2 Hz, below 20 Hz and thinned, and its mean."""
    whole = bridge(np.asarray(row, dtype=np.float64), real)
    mean = float(whole.mean()) if len(whole) else 0.0
    whole = centred(whole)
    band = lowpass(whole, BAND_HZ, track.rate_hz)[:: track.step].copy()
    return lowpass(whole, LOW_HZ, track.rate_hz), band, mean


def _less(one: Pair, other: Pair) -> Pair:
    """Return the difference of two pairs."""
    return Pair(one.measured - other.measured, one.simulated - other.simulated)
