"""Point-by-point agreement of two signals on one grid, in time and in their spectra."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import fft, signal

from escalator_twin.metrics.filters import centred, inner, ROUNDING, thinning
from escalator_twin.signals import Floats

SPECTRUM_SAMPLES = 20.0  # kept per period of the highest frequency asked for


def deviation(values: Floats) -> float:
    """Return the standard deviation of ``values`` (n,), exactly 0 where they are constant."""
    if len(values) < 2:
        return 0.0
    less = centred(values)
    return float(np.sqrt(inner(less, less) / len(less)))


@dataclass(frozen=True, slots=True)
class Products:
    """Sums of products of two signals less their means: what point-by-point scores are made of.

    Attributes
    ----------
    measured, simulated : float
        Of each with itself, its unit squared; exactly 0 where it is constant.
    shared : float
        Of one with the other.
    difference : float
        Of measured less simulated with itself.
    n : int
        Samples.
    """

    measured: float
    simulated: float
    shared: float
    difference: float
    n: int

    @property
    def correlation(self) -> float | None:
        """Pearson's correlation; `None` where one signal is constant."""
        scale = np.sqrt(self.measured) * np.sqrt(self.simulated)
        return float(np.clip(self.shared / scale, -1.0, 1.0)) if scale > 0.0 else None

    @property
    def nrmse(self) -> float | None:
        """Root mean square difference over the measured deviation; `None` where that is 0."""
        if not self.measured > 0.0:
            return None
        return float(np.sqrt(self.difference / self.measured))


def products(measured: Floats, simulated: Floats) -> Products:
    """Return the sums of products of two signals (n,); all 0 for fewer than two samples."""
    n = len(measured)
    if n < 2:
        return Products(0.0, 0.0, 0.0, 0.0, n)
    m, s = centred(measured), centred(simulated)
    own, other, shared = inner(m, m), inner(s, s), inner(m, s)
    # by itself: from the other three it would be the small difference of large numbers
    difference = m - s
    return Products(own, other, shared, inner(difference, difference), n)


def correlation(measured: Floats, simulated: Floats) -> float | None:
    """Return Pearson's correlation of two signals (n,), unitless.

    ``None`` where one of them is constant or fewer than two samples are there.
    """
    return products(measured, simulated).correlation


def nrmse(measured: Floats, simulated: Floats) -> float | None:
    """Return the root mean square difference over the measured standard deviation, unitless.

    Means are removed first. ``None`` where the measured signal (n,) is constant.
    """
    return products(measured, simulated).nrmse


def amplitude_spectrum(values: Floats, rate_hz: float, up_to_hz: float) -> Floats:
    """Return the amplitudes of the bins above 0 up to ``up_to_hz`` behind a Hann window.

    The bins are those of the full length n, k rate / n, whatever its prime factors: the
    windowed signal is thinned and its spectrum taken at these bins by the chirp-z transform.

    Parameters
    ----------
    values : (n,) float64
        A signal that holds nothing above ten times ``up_to_hz``, as behind a low-pass.
    rate_hz : float
        Its rate, Hz.
    up_to_hz : float
        Highest frequency asked for, Hz.

    Returns
    -------
    amplitudes : (k,) float64
        Unit of ``values``; empty where no bin lies in the range.
    """
    n = len(values)
    n_bins = min(int(up_to_hz * n / rate_hz + 1e-9), (n - 1) // 2)
    if n_bins < 1:
        return np.zeros(0)
    # the chirp-z transform needs two bins to step between
    step = thinning(rate_hz, SPECTRUM_SAMPLES * up_to_hz) if n_bins > 1 else 1
    mean = float(values.mean())
    thin = values[::step] - mean
    if np.abs(thin).max() <= ROUNDING * abs(mean):
        return np.zeros(n_bins)
    thin *= 0.5 - 0.5 * np.cos(2.0 * np.pi / n * np.arange(0, n, step))
    transform = _plain if step == 1 else _zoom(len(thin), n, n_bins, step)
    lines = transform(thin)[:n_bins]
    # a Hann window passes half of a line's amplitude, a real line splits in two
    return np.abs(lines) * (4.0 * step / n)


def _plain(values: Floats) -> NDArray[np.complex128]:
    """Return the bins above 0."""
    return np.asarray(fft.rfft(values)[1:])


@lru_cache(maxsize=1)
def _zoom(n_thin: int, n: int, n_bins: int, step: int) -> signal.ZoomFFT:
    """Plan the transform of ``n_thin`` samples at the bins 1 to ``n_bins`` of ``n`` samples."""
    return signal.ZoomFFT(n_thin, (step / n, n_bins * step / n), n_bins, fs=1.0, endpoint=True)


def spectrum_correlation(
    measured: Floats, simulated: Floats, rate_hz: float, up_to_hz: float
) -> float | None:
    """Return Pearson's correlation of two signals' amplitude spectra, unitless.

    Hann window, bins above 0 up to ``up_to_hz``; ``None`` for fewer than two bins or where
    one signal is constant.
    """
    return correlation(
        amplitude_spectrum(measured, rate_hz, up_to_hz),
        amplitude_spectrum(simulated, rate_hz, up_to_hz),
    )
