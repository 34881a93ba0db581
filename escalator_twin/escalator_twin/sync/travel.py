"""Refine where every sample was taken: travel as a smooth function of time."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import BSpline, CubicSpline

from escalator_twin.metrics.filters import lowpass
from escalator_twin.signals import Floats
from escalator_twin.sync.timeline import Timed

KNOT_S = 8.0  # the slowest wander that the data sheet names has a period of 30 s
BAND_HZ = 2.0
FIT_RATE_HZ = 10.0
EDGE_S = 1.0  # filter transients at the ends
HUBER = 2.0  # residuals beyond this many robust deviations count linearly
PASSES = 6
DEPENDENT = FIT_RATE_HZ / (2.0 * BAND_HZ)  # samples to a free value: the band is narrower


@dataclass(frozen=True)
class Travel:
    """Travel of the machine since a reference, as a smooth function of reference time.

    ``travel(t) = speed * t + offset(t)`` with ``offset`` a cubic spline.

    Attributes
    ----------
    speed_m_s : float
        Mean speed over the recording, positive.
    low_m_s, high_m_s : float
        95 % interval of the mean speed.
    spline : BSpline
        Of the offset, m.
    """

    speed_m_s: float
    low_m_s: float
    high_m_s: float
    base_m_s: float
    spline: BSpline

    def at(self, time_s: Floats) -> Floats:
        """Return travel at reference times, m."""
        knots = self.spline.t
        inside = np.clip(time_s, knots[0], knots[-1])
        return self.base_m_s * time_s + self.spline(inside)

    def shifted(self, by_m: float) -> 'Travel':
        """Return the same travel counted from another zero."""
        spline = BSpline(self.spline.t, self.spline.c + by_m, self.spline.k)
        return replace(self, spline=spline)


@dataclass(frozen=True)
class Ground:
    """By how much signals ask for the reference logger's time to be moved.

    Its sample at ``t`` belongs to ``t + shift_s + rate * t`` of the other loggers' time axis.

    Attributes
    ----------
    shift_s, rate : float
        s and s/s.
    shift_sd_s, rate_sd : float
        Standard deviations.
    """

    shift_s: float = 0.0
    rate: float = 0.0
    shift_sd_s: float = 0.0
    rate_sd: float = 0.0


HELD = Ground()


@dataclass(frozen=True)
class Fit:
    """A travel and the residual scale of each channel that it was found with."""

    travel: Travel
    scale: Mapping[str, float]
    ground: Ground


def _knots(start: float, end: float) -> Floats:
    """Return clamped knots of a cubic spline over [start, end], about KNOT_S apart."""
    inner = np.linspace(start, end, max(2, round((end - start) / KNOT_S) + 1))
    return np.concatenate([[start] * 3, inner, [end] * 3])


@dataclass(frozen=True)
class _Row:
    """One channel prepared for the fit."""

    time_s: Floats
    measured: Floats
    model: CubicSpline
    slope: CubicSpline
    on_ground: bool
    noise: float


def _prepare(track: Timed, model: Floats, travel: Floats, on_ground: bool, noise: float) -> _Row:
    """Low-pass a channel and its template and thin the samples to what the band needs."""
    step = max(1, round(track.rate_hz / FIT_RATE_HZ))
    keep = slice(round(EDGE_S * track.rate_hz), -round(EDGE_S * track.rate_hz), step)
    smooth = lowpass(track.values, BAND_HZ, track.rate_hz)
    good = track.valid[keep]
    curve = CubicSpline(travel, model)
    return _Row(
        track.time_s[keep][good], smooth[keep][good], curve, curve.derivative(), on_ground, noise
    )


def fit_travel(
    tracks: Mapping[str, Timed],
    templates: Mapping[str, Floats],
    template_travel_m: Floats,
    template_rate_hz: float,
    base_m_s: float,
    start_m: float,
    wander: float,
    ground: frozenset[str] = frozenset(),
    ground_prior: Ground = HELD,
    first: Travel | None = None,
    noise: Mapping[str, float] | None = None,
) -> Fit:
    """Fit travel over time so that measured and simulated signals agree below 2 Hz.

    Minimises, by Gauss-Newton with Huber weights, the squared differences of all channels, each
    with a free mean and scaled by its own robust residual; the spline's speed is held near the
    base speed by the stated wander.

    Parameters
    ----------
    tracks : mapping of channel to Timed
    templates : mapping of channel to (n,) float64
        Simulated at constant speed, on ``template_travel_m``.
    template_travel_m : (n,) float64
        Increasing, even, m; must cover the recording.
    template_rate_hz : float
        Rate at which the templates were simulated, for the common low-pass.
    base_m_s : float
        First estimate of the mean speed.
    start_m : float
        Template travel at reference time 0.
    wander : float
        Relative speed wander that a machine may have.
    ground : frozenset of str
        Channels of the reference logger, whose time may be moved.
    ground_prior : Ground
        Where that begins and how far it may go (standard deviations; 0 holds it).
    first : Travel, optional
        A travel to begin with instead of ``start_m``.
    noise : mapping, optional
        Smallest residual scale of each channel, in its unit.
    """
    floor = noise or {}
    rows = {
        c: _prepare(
            tracks[c],
            lowpass(templates[c], BAND_HZ, template_rate_hz),
            template_travel_m,
            c in ground,
            floor.get(c, 0.0),
        )
        for c in tracks
        if c in templates
    }
    start = min(r.time_s[0] for r in rows.values()) - EDGE_S
    end = max(r.time_s[-1] for r in rows.values()) + EDGE_S
    knots = _knots(float(start), float(end))
    n = len(knots) - 4
    sites = np.array([knots[i + 1 : i + 4].mean() for i in range(n)])
    if first is None:
        coefficients = np.full(n, start_m)
    else:
        coefficients = first.at(sites) - base_m_s * sites
    bases = {c: BSpline.design_matrix(r.time_s, knots, 3).toarray() for c, r in rows.items()}
    # prior: speed offset of each knot interval within the wander, first guess of speed loosely
    slope = np.diff(np.eye(n), axis=0) / np.diff(sites)[:, None]
    prior = np.diff(slope, axis=0) / (2.0 * wander * base_m_s)
    begun = np.array([ground_prior.shift_s, ground_prior.rate])
    held = 1.0 / np.maximum([ground_prior.shift_sd_s, ground_prior.rate_sd], [1e-9, 1e-12]) ** 2
    moved = begun.copy()
    scale: dict[str, float] = {}
    covariance = np.eye(n + 2)
    for _ in range(PASSES):
        normal = np.zeros((n + 2, n + 2))
        right = np.zeros(n + 2)
        normal[:n, :n] += prior.T @ prior
        right[:n] -= prior.T @ (prior @ coefficients)
        normal[[n, n + 1], [n, n + 1]] += held
        right[n:] -= held * (moved - begun)
        for c, row in rows.items():
            basis = bases[c]
            late = (moved[0] + moved[1] * row.time_s) * row.on_ground
            here = base_m_s * (row.time_s + late) + basis @ coefficients
            here = np.clip(here, template_travel_m[0], template_travel_m[-1])
            residual = row.measured - row.model(here)
            residual -= np.median(residual)
            scale[c] = max(1.4826 * float(np.median(np.abs(residual))), row.noise, 1e-12)
            weight = 1.0 / np.maximum(1.0, np.abs(residual) / (HUBER * scale[c])) / scale[c] ** 2
            rate = row.slope(here)
            by_time = base_m_s * rate * float(row.on_ground)
            jacobian = np.column_stack(
                [basis * rate[:, None], by_time, by_time * row.time_s]
            )
            centre = weight @ jacobian / weight.sum()
            jacobian -= centre
            residual = residual - weight @ residual / weight.sum()
            normal += jacobian.T @ (jacobian * weight[:, None])
            right += jacobian.T @ (residual * weight)
        change = np.linalg.solve(normal, right)
        coefficients = coefficients + change[:n]
        moved = moved + change[n:]
        covariance = np.linalg.inv(normal)
        if np.abs(change[:n]).max() < 1e-6:
            break
    return _finish(knots, coefficients, covariance, base_m_s, (start, end), scale, moved)


def _finish(
    knots: Floats,
    coefficients: Floats,
    covariance: Floats,
    base_m_s: float,
    span: tuple[float, float],
    scale: Mapping[str, float],
    moved: Floats,
) -> Fit:
    """Turn coefficients into a Travel with the interval of its mean speed."""
    spline = BSpline(knots, coefficients, 3)
    duration = span[1] - span[0]
    ends = BSpline.design_matrix(np.array(span), knots, 3).toarray()
    difference = (ends[1] - ends[0]) / duration
    speed = base_m_s + float(difference @ coefficients)
    n = len(coefficients)
    covariance = DEPENDENT * covariance
    deviation = float(np.sqrt(difference @ covariance[:n, :n] @ difference))
    travel = Travel(speed, speed - 1.96 * deviation, speed + 1.96 * deviation, base_m_s, spline)
    ground = Ground(
        float(moved[0]), float(moved[1]), *(float(np.sqrt(covariance[k, k])) for k in (n, n + 1))
    )
    return Fit(travel, dict(scale), ground)
