"""A recording and the machine beside it, on the grid along travel."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy import fft, ndimage
from scipy.interpolate import CubicSpline

from escalator_twin.comparison.judge import Judgement
from escalator_twin.comparison.locate import Setting
from escalator_twin.diagnosis.grids import band_limited, Frame
from escalator_twin.machine import Machine
from escalator_twin.physics.rollout import Trace
from escalator_twin.signals import Floats

EDGE_S = 1.0  # of the recording left out at both ends: the filters' transients

PAD = 12  # rows beyond an end, after which 1e-7 of what a spline does there is left


@dataclass(frozen=True)
class Observation:
    """Measured signals on the grid along travel.

    Attributes
    ----------
    frame : Frame
    channels : tuple of str
        Those of the machine that the recording has.
    index : (n,) int64
        Grid points, counted from path coordinate 0 of axle 0 in the loop where the run began.
    time_s : (n, c) float64
        Reference time at which each channel passed the grid points.
    measured : (n, c) float64
    valid : (n, c) bool
    start_m : float
        Travel from path coordinate 0 of axle 0 to where the twin's run began.
    rotation_rad : tuple of float
        Rotation vector of the acceleration sensor in the step's frame, as the comparison found it.
    """

    frame: Frame
    channels: tuple[str, ...]
    index: np.ndarray
    time_s: Floats
    measured: Floats
    valid: np.ndarray
    start_m: float
    rotation_rad: tuple[float, ...] = (0.0, 0.0, 0.0)

    @property
    def travel_m(self) -> Floats:
        """Travel since the twin's run began, m."""
        return self.index * self.frame.spacing_m - self.start_m


def observe(
    setting: Setting, judgement: Judgement, machine: Machine, frame: Frame, start_m: float
) -> Observation:
    """Put the measured channels onto the grid along travel.

    Parameters
    ----------
    setting : Setting
        Its tracks are taken: no bias and no rotation is removed.
    judgement : Judgement
        For each sample's travel.
    machine : Machine
    frame : Frame
    start_m : float
        Travel from path coordinate 0 of axle 0 to where the twin's run began.
    """
    channels = tuple(
        s.channel for s in machine.instruments.sensors if s.channel in judgement.channels
    )
    spacing = frame.spacing_m
    first = max(
        float(np.interp(setting.tracks[c].time_s[0] + EDGE_S, *_course(judgement, c)))
        for c in channels
    )
    last = min(
        float(np.interp(setting.tracks[c].time_s[-1] - EDGE_S, *_course(judgement, c)))
        for c in channels
    )
    index = np.arange(
        int(np.ceil((first + start_m) / spacing)), int(np.floor((last + start_m) / spacing)) + 1
    )
    # cosine transforms of every column are of this length: with large prime factors they take five times as long
    index = index[: fft.prev_fast_len(len(index))]
    travel = index * spacing - start_m
    measured = np.empty((len(index), len(channels)))
    time = np.empty_like(measured)
    valid = np.empty(measured.shape, bool)
    for k, channel in enumerate(channels):
        track = setting.tracks[channel]
        way = np.maximum.accumulate(judgement.channels[channel].travel_m)
        seconds = track.time_s[: len(way)]
        when = np.interp(travel, way, seconds)
        values = band_limited(track.values[: len(way), None], track.rate_hz)
        measured[:, k] = CubicSpline(seconds, values)(when)[:, 0]
        time[:, k] = when
        good = np.interp(travel, way, track.valid[: len(way)].astype(float)) > 0.999
        valid[:, k] = _widened(good, round(0.1 * frame.rate_hz))
    pose = tuple(np.deg2rad(judgement.pose.get('rotation_deg', (0.0, 0.0, 0.0))).tolist())
    return Observation(frame, channels, index, time, measured, valid, start_m, pose)


def _course(judgement: Judgement, channel: str) -> tuple[Floats, Floats]:
    """Return time and travel of a channel's samples."""
    aligned = judgement.channels[channel]
    return aligned.time_s, np.maximum.accumulate(aligned.travel_m)


def _widened(good: np.ndarray, by: int) -> np.ndarray:
    """Return a mask whose gaps are ``by`` points wider on both sides."""
    if good.all():
        return good
    bad = np.convolve(~good, np.ones(2 * by + 1), 'same') > 0.5
    return np.asarray(~bad)


def on_grid(
    trace: Trace,
    speed_m_s: float,
    observation: Observation,
    columns: Mapping[str, int],
    shift_m: float = 0.0,
) -> Floats:
    """Put a run of the twin onto the observation's grid.

    Parameters
    ----------
    trace : Trace
        At constant speed from where the observation's travel begins.
    speed_m_s : float
    observation : Observation
    columns : mapping of channel to column
    shift_m : float
        Of the run's travel, see ``rack_shift``.

    Returns
    -------
    simulated : (n, c) float64
    """
    rate = 1.0 / float(trace.time_s[1] - trace.time_s[0])
    picked = trace.columns[:, [columns[c] for c in observation.channels]]
    smooth = band_limited(picked, rate)
    return spline_at(smooth, (observation.travel_m - shift_m) / speed_m_s * rate)


def slope_along(values: Floats, spacing_m: float) -> Floats:
    """Return the slope per m, (n, c), of the cubic spline through columns of an even grid, on it."""
    weights = _spline_weights(values)
    slope = (weights[2:] - weights[:-2]) / (2.0 * spacing_m)
    return np.asarray(slope[PAD - 1 : 1 - PAD])


def spline_at(values: Floats, where: Floats) -> Floats:
    """Return columns (n, c) of even samples at fractional rows, by the cubic spline through them."""
    weights = _spline_weights(values)
    first = np.clip(np.floor(where).astype(int), 0, len(values) - 2)
    f = (where - first)[:, None]
    g = 1.0 - f
    k = first + PAD
    # the four cubic B-splines about a place (de Boor 1978, chapter IX)
    found = g**3 * weights[k - 1] + f**3 * weights[k + 2]
    found += (4.0 - 3.0 * f**2 * (1.0 + g)) * weights[k]
    found += (4.0 - 3.0 * g**2 * (1.0 + f)) * weights[k + 1]
    return np.asarray(found / 6.0)


def _spline_weights(values: Floats) -> Floats:
    """Return the B-splines' weights of columns that go on beyond both ends, mirrored in their end points."""
    padded = np.pad(values, ((PAD, PAD), (0, 0)), mode='reflect', reflect_type='odd')
    weights: Floats = ndimage.spline_filter1d(padded, axis=0, mode='mirror')
    return weights
