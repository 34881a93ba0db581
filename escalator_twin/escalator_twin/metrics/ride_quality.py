"""Ride quality of step acceleration after ISO 18738-2, as far as a step-mounted sensor allows.

ISO 18738-2:2012 (since 2022 ISO 8103-9) sets no limits; it says how to measure. Its text is
not public. What is done here rests on public excerpts of the national standards made from it
(GB/T 24474.2-2020; DB35/T 1936-2020, clause 4.3) and on the instructions of an instrument for it
(Henning, Escalator Analysis According to ISO18738-2):

- acceleration on the load carrying unit, axes x, y and z, in the middle of a step: applies;
- weighted by the whole-body combined weighting and its band limits of ISO 8041, the same for all
  three axes: applies. It is `COMBINED`, Wm of ISO 8041:2005. Frequencies above half the sensor's
  rate are not there;
- running rms with a time constant of 1 s, its maximum reported: applies;
- measured from the start of the incline until just before its end, at steady speed: applies, as
  the mask of `ride_quality`. A recording that begins on the incline gives a shorter pass;
- sensor flat on the tread, pressed on, a person on the step behind: does not apply. The sensor is
  rigid with the link, turns with it round the transitions and turnarounds, and is turned back
  by the inclination here; feet, cleats and tread are not in its way;
- handrail vibration and sound: do not apply, nothing measures them;
- start and stop: not part of the standard's figures, and of no recording.

Gravity is constant on the straight incline and goes with the mean of each pass, which takes a
sensor's bias along. Beside the standard's figures stand those of ISO 2631-1 for standing
persons, Wk vertical and Wd horizontal, and the peak-to-peak values of the lift part
(ISO 18738-1: two successive peaks of opposite sign; A95 is not exceeded by 95 % of them).
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from math import cos, inf, pi, radians, sin, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy import fft, signal

from escalator_twin.metrics.filters import bridge, Mask
from escalator_twin.signals import Floats

Factors = NDArray[np.complexfloating]

AXES = ('x', 'y', 'z')
TIME_CONSTANT_S = 1.0  # of the running rms, DB35/T 1936-2020, clause 4.3; ISO 2631-1, 6.3.1
SHORTEST_S = 3.0 * TIME_CONSTANT_S  # the running mean square has reached 95 % of its level
MISSING = 0.02  # share of a pass that may be missing and is bridged
FEWEST_PEAKS = 20  # below, 5 % of the peak-to-peak values are less than one
PERCENTILE = 95.0
SILENCE_S = 8.0  # appended; the slowest pole, 0.4 Hz, has then decayed to 1e-6


@dataclass(frozen=True)
class Weighting:
    """A frequency weighting by the parameters of ISO 8041, Hz.

    High-pass ``f1`` and low-pass ``f2``, second order, Q 1/sqrt(2); transition from acceleration
    to velocity at ``f3`` and ``f4``, ``q4``; upward step from ``f5``, ``q5`` to ``f6``, ``q6``,
    none where ``f5`` is infinite.
    """

    f1: float
    f2: float
    f3: float
    f4: float
    q4: float
    f5: float = inf
    q5: float = 1.0
    f6: float = inf
    q6: float = 1.0

    def at(self, frequency_hz: Floats) -> Factors:
        """Return the factors (n,) at the given frequencies, complex: also the phase."""
        s = 1j * frequency_hz
        high = s**2 / (s**2 + sqrt(2.0) * self.f1 * s + self.f1**2)
        low = self.f2**2 / (s**2 + sqrt(2.0) * self.f2 * s + self.f2**2)
        transition = (1.0 + s / self.f3) / (1.0 + s / (self.q4 * self.f4) + (s / self.f4) ** 2)
        return high * low * transition * self._step(s)

    def _step(self, s: Factors) -> Factors:
        """Return the upward step."""
        if self.f5 == inf:
            return np.ones(s.shape, np.complex128)
        top = s**2 + self.f5 / self.q5 * s + self.f5**2
        return np.asarray(top / (s**2 + self.f6 / self.q6 * s + self.f6**2), np.complex128)


# ISO 8041:2005, table of parameters, as printed in the manual of Larson Davis HVM200, table 3.1
COMBINED = Weighting(10.0**-0.1, 100.0, 1 / (0.028 * 2 * pi), 1 / (0.028 * 2 * pi), 0.5)  # Wm
VERTICAL = Weighting(0.4, 100.0, 12.5, 12.5, 0.63, 2.37, 0.91, 3.35, 0.91)  # Wk
HORIZONTAL = Weighting(0.4, 100.0, 2.0, 2.0, 0.63)  # Wd
COMFORT = {'x': HORIZONTAL, 'y': HORIZONTAL, 'z': VERTICAL}


@dataclass(frozen=True)
class AxisRide:
    """Ride quality along one axis; m/s2 unless named otherwise.

    Attributes
    ----------
    n_passes : int
        Passes over the incline that were evaluated, of 3 s or more.
    duration_s : float
        Of all these passes.
    rms, max_running_rms : float
        Combined weighting; the maximum is what the standard reports.
    peak_to_peak, a95_peak_to_peak : float or None
        Combined weighting, as the lift part defines them; None below 20 values.
    comfort_rms, comfort_max_running_rms : float
        Wk or Wd of ISO 2631-1; the maximum is its transient value MTVV.
    """

    n_passes: int
    duration_s: float
    rms: float
    max_running_rms: float
    peak_to_peak: float | None
    a95_peak_to_peak: float | None
    comfort_rms: float
    comfort_max_running_rms: float


@dataclass(frozen=True)
class RideQuality:
    """Ride quality along the axes of the tread; None where it is undefined.

    Attributes
    ----------
    x, y, z : AxisRide or None
        Along the horizontal way of travel, to the side, upwards.
    """

    x: AxisRide | None
    y: AxisRide | None
    z: AxisRide | None

    def document(self) -> dict[str, dict[str, float | int | None]]:
        """Return the axes as mappings of plain numbers; an undefined axis has only None."""
        names = [f.name for f in fields(AxisRide)]
        axes = {axis: getattr(self, axis) for axis in AXES}
        return {a: {n: getattr(ride, n, None) for n in names} for a, ride in axes.items()}


def ride_quality(
    xyz: Floats, rate_hz: float, on_passenger_run: Mask, inclination_deg: float = 0.0
) -> RideQuality:
    """Evaluate the acceleration of a step on its passes over the incline.

    Parameters
    ----------
    xyz : (n, 3) float64
        Specific force in the frame of the step, m/s2; NaN where a sample is missing, a whole
        column of it where an axis is.
    rate_hz : float
    on_passenger_run : (n,) bool
        Samples at which the step runs straight on the passenger side.
    inclination_deg : float
        Of the straight run; x and z are turned back by it into the tread's.
    """
    c, s = cos(radians(inclination_deg)), sin(radians(inclination_deg))
    x, y, z = xyz.T
    if inclination_deg != 0.0:
        x, z = c * x - s * z, s * x + c * z
    rides = {
        axis: _axis(row, rate_hz, on_passenger_run, COMFORT[axis])
        for axis, row in zip(AXES, (x, y, z), strict=True)
    }
    return RideQuality(**rides)


def weighted_noise(noise: Mapping[str, float], rate_hz: float) -> dict[str, float]:
    """Return what white noise of the given deviations (m/s2) adds to `AxisRide.rms`."""
    frequency = np.linspace(0.0, 0.5 * rate_hz, 4097)
    share = sqrt(float(np.mean(np.abs(COMBINED.at(frequency)) ** 2)))
    return {axis: share * deviation for axis, deviation in noise.items()}


def weighted(values: Floats, rate_hz: float, weighting: Weighting) -> Floats:
    """Return ``values`` (n,) weighted, from rest; exact at every frequency below half the rate."""
    n = fft.next_fast_len(len(values) + int(np.ceil(SILENCE_S * rate_hz)), real=True)
    spectrum = fft.rfft(values, n) * weighting.at(fft.rfftfreq(n, 1.0 / rate_hz))
    return np.asarray(fft.irfft(spectrum, n)[: len(values)])


def running_rms(values: Floats, rate_hz: float) -> Floats:
    """Return the running rms (n,) of ``values``, averaged exponentially over 1 s, from rest."""
    new = 1.0 - np.exp(-1.0 / (TIME_CONSTANT_S * rate_hz))
    return np.sqrt(np.maximum(signal.lfilter([new], [1.0, new - 1.0], values**2), 0.0))


def peaks_to_peaks(values: Floats) -> Floats:
    """Return the sums (k,) of successive peaks of opposite sign; whole half waves only."""
    crossings = np.flatnonzero(np.diff(np.signbit(values))) + 1
    if len(crossings) < 3:
        return np.empty(0)
    size = np.abs(values[: crossings[-1]])
    peaks = np.maximum.reduceat(size, crossings[:-1])
    return np.asarray(peaks[1:] + peaks[:-1])


def _axis(row: Floats, rate_hz: float, mask: Mask, comfort: Weighting) -> AxisRide | None:
    """Evaluate one axis, None where no pass of it is long and whole enough."""
    passes = list(_passes(row, rate_hz, mask))
    if not passes:
        return None
    rows = [weighted(one, rate_hz, COMBINED) for one in passes]
    others = [weighted(one, rate_hz, comfort) for one in passes]
    sums = np.concatenate([peaks_to_peaks(one) for one in rows])
    enough = len(sums) >= FEWEST_PEAKS
    return AxisRide(
        n_passes=len(passes),
        duration_s=sum(map(len, passes)) / rate_hz,
        rms=_rms(rows),
        max_running_rms=max(float(running_rms(one, rate_hz).max()) for one in rows),
        peak_to_peak=float(sums.max()) if enough else None,
        a95_peak_to_peak=float(np.percentile(sums, PERCENTILE)) if enough else None,
        comfort_rms=_rms(others),
        comfort_max_running_rms=max(float(running_rms(one, rate_hz).max()) for one in others),
    )


def _passes(row: Floats, rate_hz: float, mask: Mask) -> Iterator[Floats]:
    """Yield the stretches of ``row`` under ``mask``, bridged and less their means."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]])))
    for start, stop in edges.reshape(-1, 2):
        one = row[start:stop]
        real = np.isfinite(one)
        if len(one) < SHORTEST_S * rate_hz or np.mean(~real) > MISSING:
            continue
        whole = bridge(one, real)
        yield whole - whole.mean()


def _rms(rows: list[Floats]) -> float:
    """Return the root mean square of all rows together."""
    return sqrt(sum(float(np.sum(row**2)) for row in rows) / sum(map(len, rows)))
