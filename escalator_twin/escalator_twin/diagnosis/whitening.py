"""Noise of every channel by frequency, and what it makes of signals on the grid."""

from collections.abc import Container, Mapping
from dataclasses import dataclass

import numpy as np
from scipy import fft

from escalator_twin.diagnosis.floor import Floor
from escalator_twin.diagnosis.grids import BAND_HZ
from escalator_twin.diagnosis.observation import Observation
from escalator_twin.machine import Machine, Sensor
from escalator_twin.signals import Floats

Columns = np.ndarray  # float32
STEEPNESS = 8  # of a low-pass, as a power of frequency


@dataclass(frozen=True)
class Whitener:
    """Turns signals on the grid into numbers of unit variance, one for each frequency.

    Attributes
    ----------
    mask : (n, c) float32 or float64, which is how precise all else is
        0 where nothing was measured, less than 1 where the twin's own error is large.
    weight : (f, c) float32
        One over the standard deviation of a cosine coefficient.
    temperature : float
        By which the variances behind ``weight`` were multiplied, see `Floor`.
    """

    mask: Columns
    weight: Columns
    temperature: float

    def __call__(self, signals: np.ndarray) -> Columns:
        """Return (f c, k) of signals (n, c, k)."""
        shape = signals.shape
        # a copy, which all that follows is done in: each one more is megabytes
        masked = signals.astype(self.mask.dtype)
        masked *= self.mask[:, :, None]
        waves = fft.dct(masked, axis=0, norm='ortho', workers=2, overwrite_x=True)
        white: Columns = waves[: len(self.weight)]
        white *= self.weight[:, :, None]
        return white.reshape(-1, shape[2])

    def along(self, signals: Floats) -> Floats:
        """Return signals (n, c) along the grid, each frequency over its standard deviation."""
        return in_travel(
            self(signals[:, :, None])[:, 0].reshape(-1, signals.shape[1]), len(signals)
        )

    def low_pass(self, cut_hz: float, rate_hz: float) -> np.ndarray:
        """Return what lets waves through up to a frequency, (f,) float32."""
        f = frequencies(len(self.mask), rate_hz)
        gain: np.ndarray = (1.0 / (1.0 + (f / cut_hz) ** STEEPNESS)).astype(np.float32)
        return gain


def in_travel(waves: np.ndarray, n: int) -> Floats:
    """Return the signals along the grid, (n, c), whose first cosine coefficients these are, (f, c)."""
    whole = np.zeros((n, waves.shape[1]))
    whole[: len(waves)] = waves
    found: Floats = fft.idct(whole, axis=0, norm='ortho')
    return found


def frequencies(n: int, rate_hz: float) -> Floats:
    """Return the frequencies of a cosine transform's coefficients up to the band's end, Hz."""
    every = 0.5 * rate_hz * np.arange(n) / n
    band: Floats = every[every <= BAND_HZ]
    return band


def sensor_variance(sensor: Sensor, rate_hz: float) -> float:
    """Return the variance of a cosine coefficient by the data sheet's noise and resolution."""
    unit = abs(sensor.scale)
    one = (sensor.noise**2 + sensor.resolution**2 / 12.0) * unit**2 / len(sensor.fields)
    return one * rate_hz / sensor.rate_hz


def make_whitener(
    observation: Observation,
    machine: Machine,
    floor: Floor,
    means: Container[str] = (),
    shares: Floats | None = None,
    noises: Mapping[str, float] | None = None,
) -> Whitener:
    """Return the whitener of an observation: the sensors' noise and the twin's own error.

    ``means`` holds the channels whose mean counts; of all others it is a zero of the instrument.
    ``shares`` says where in the loop, 0 to 1, the step of each channel is, (n, c). ``noises`` are those of repaired
    channels, times a sound one's.
    """
    frame, n = observation.frame, len(observation.index)
    f = frequencies(n, frame.rate_hz)
    orders = f * frame.pitch_m / frame.speed_m_s
    weight = np.empty((len(f), len(observation.channels)))
    for k, channel in enumerate(observation.channels):
        sensor = machine.instruments.sensor(channel)
        own = sensor_variance(sensor, frame.rate_hz)
        variance = floor.variance(sensor, own, orders, frame.speed_m_s, n)
        more = (noises or {}).get(channel, 1.0) ** 2 - 1.0
        weight[:, k] = 1.0 / np.sqrt(variance + more * own)
    weight[0] *= [channel in means for channel in observation.channels]
    weight /= floor.temperature**0.5
    mask = observation.valid.astype(np.float32)
    if shares is not None:
        for k, channel in enumerate(observation.channels):
            sensor = machine.instruments.sensor(channel)
            mask[:, k] /= floor.spread(sensor, shares[:, k], frame.speed_m_s)
    return Whitener(mask, weight.astype(np.float32), floor.temperature)
