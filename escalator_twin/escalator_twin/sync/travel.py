"""Refine where every sample was taken: travel as a smooth function of time."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import BSpline, CubicSpline

from escalator_twin.metrics.filters import lowpass
from escalator_twin.signals import Floats
from escalator_twin.sync.template import Templates
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
class Guess:
    """Where the fit begins.

    Attributes
    ----------
    base_m_s : float
        First estimate of the mean speed.
    start_m : float
        Travel of the templates at reference time 0; not used where ``travel`` is given.
    wander : float
        Relative slow wander that the speed may have.
    travel : Travel, optional
        An earlier fit to begin with.
    """

    base_m_s: float
    start_m: float = 0.0
    wander: float = 0.002
    travel: Travel | None = None


@dataclass(frozen=True)
class _Row:
    """One channel prepared for the fit: samples, template and its slope, spline basis."""

    channel: str
    time_s: Floats
    measured: Floats
    model: CubicSpline
    slope: CubicSpline
    basis: Floats
    on_ground: bool


@dataclass(frozen=True)
class _Problem:
    """All rows of a fit, with the priors on the spline and on the reference's clock."""

    rows: tuple[_Row, ...]
    knots: Floats
    span: tuple[float, float]
    base_m_s: float
    reach: tuple[float, float]
    smooth: Floats
    prior: Ground

    @property
    def n(self) -> int:
        """Coefficients of the spline."""
        return len(self.knots) - 4

    @property
    def held(self) -> Floats:
        """Weights that hold the reference's shift and rate."""
        floor = np.array([1e-9, 1e-12])
        return 1.0 / np.maximum([self.prior.shift_sd_s, self.prior.rate_sd], floor) ** 2

    def step(self, coefficients: Floats, moved: Floats) -> tuple[Floats, Floats, dict[str, float]]:
        """Return normal matrix, right side and residual scales of one Gauss-Newton step."""
        n = self.n
        begun = np.array([self.prior.shift_s, self.prior.rate])
        normal, right = np.zeros((n + 2, n + 2)), np.zeros(n + 2)
        normal[:n, :n] += self.smooth.T @ self.smooth
        right[:n] -= self.smooth.T @ (self.smooth @ coefficients)
        normal[[n, n + 1], [n, n + 1]] += self.held
        right[n:] -= self.held * (moved - begun)
        scales = {}
        for row in self.rows:
            scale, jacobian, weight, residual = self._linear(row, coefficients, moved)
            scales[row.channel] = scale
            normal += jacobian.T @ (jacobian * weight[:, None])
            right += jacobian.T @ (residual * weight)
        return normal, right, scales

    def _linear(
        self, row: _Row, coefficients: Floats, moved: Floats
    ) -> tuple[float, Floats, Floats, Floats]:
        """Return scale, Jacobian, Huber weights and residual of one row, its mean free."""
        late = (moved[0] + moved[1] * row.time_s) * row.on_ground
        here = self.base_m_s * (row.time_s + late) + row.basis @ coefficients
        here = np.clip(here, *self.reach)
        residual = row.measured - row.model(here)
        residual -= np.median(residual)
        scale = max(1.4826 * float(np.median(np.abs(residual))), 1e-12)
        weight = 1.0 / np.maximum(1.0, np.abs(residual) / (HUBER * scale)) / scale**2
        rate = row.slope(here)
        by_time = self.base_m_s * rate * float(row.on_ground)
        jacobian = np.column_stack([row.basis * rate[:, None], by_time, by_time * row.time_s])
        jacobian -= weight @ jacobian / weight.sum()
        return scale, jacobian, weight, residual - weight @ residual / weight.sum()


def _row(track: Timed, templates: Templates, knots: Floats, on_ground: bool) -> _Row:
    """Low-pass a channel and its template and thin the samples to what the band needs."""
    step = max(1, round(track.rate_hz / FIT_RATE_HZ))
    keep = slice(round(EDGE_S * track.rate_hz), -round(EDGE_S * track.rate_hz), step)
    good = track.valid[keep]
    time = track.time_s[keep][good]
    smooth = lowpass(templates.columns[track.channel], BAND_HZ, templates.rate_hz)
    curve = CubicSpline(templates.travel_m, smooth)
    return _Row(
        track.channel,
        time,
        lowpass(track.values, BAND_HZ, track.rate_hz)[keep][good],
        curve,
        curve.derivative(),
        BSpline.design_matrix(time, knots, 3).toarray(),
        on_ground,
    )


def _problem(
    tracks: Mapping[str, Timed],
    templates: Templates,
    guess: Guess,
    ground: frozenset[str],
    prior: Ground,
) -> _Problem:
    """Prepare all channels that both sides have."""
    common = [t for c, t in tracks.items() if c in templates.columns]
    span = (
        min(float(t.time_s[0]) for t in common) - EDGE_S,
        max(float(t.time_s[-1]) for t in common) + EDGE_S,
    )
    knots = _knots(*span)
    n = len(knots) - 4
    # prior: from one knot interval to the next the speed changes by about the wander
    slope = np.diff(np.eye(n), axis=0) / np.diff(_sites(knots))[:, None]
    smooth = np.diff(slope, axis=0) / (2.0 * guess.wander * guess.base_m_s)
    return _Problem(
        tuple(_row(t, templates, knots, t.channel in ground) for t in common),
        knots,
        span,
        guess.base_m_s,
        (float(templates.travel_m[0]), float(templates.travel_m[-1])),
        smooth,
        prior,
    )


def _sites(knots: Floats) -> Floats:
    """Return the times at which a spline's coefficients act (Greville's abscissae)."""
    return np.array([knots[i + 1 : i + 4].mean() for i in range(len(knots) - 4)])


def fit_travel(
    tracks: Mapping[str, Timed],
    templates: Templates,
    guess: Guess,
    ground: frozenset[str] = frozenset(),
    ground_prior: Ground = HELD,
) -> Fit:
    """Fit travel over time so that measured and simulated signals agree below 2 Hz.

    Minimises, by Gauss-Newton with Huber weights, the squared differences of all channels, each
    with a free mean and scaled by its own robust residual; the spline's speed is held smooth by
    the stated wander.

    Parameters
    ----------
    tracks : mapping of channel to Timed
    templates : Templates
        Must cover the recording.
    guess : Guess
    ground : frozenset of str
        Channels of the reference logger, whose time may be moved.
    ground_prior : Ground
        Where that begins and how far it may go (standard deviations; 0 holds it).
    """
    problem = _problem(tracks, templates, guess, ground, ground_prior)
    n = problem.n
    coefficients = np.full(n, guess.start_m)
    if guess.travel is not None:
        sites = _sites(problem.knots)
        coefficients = guess.travel.at(sites) - guess.base_m_s * sites
    moved = np.array([ground_prior.shift_s, ground_prior.rate])
    for _ in range(PASSES):
        normal, right, scales = problem.step(coefficients, moved)
        change = np.linalg.solve(normal, right)
        coefficients = coefficients + change[:n]
        moved = moved + change[n:]
        if np.abs(change[:n]).max() < 1e-6:
            break
    covariance: Floats = np.linalg.inv(normal) * np.float64(DEPENDENT)
    return _finish(problem, coefficients, moved, covariance, scales)


def _finish(
    problem: _Problem,
    coefficients: Floats,
    moved: Floats,
    covariance: Floats,
    scales: Mapping[str, float],
) -> Fit:
    """Turn coefficients into a Travel with the interval of its mean speed."""
    spline = BSpline(problem.knots, coefficients, 3)
    start, end = problem.span
    ends = BSpline.design_matrix(np.array([start, end]), problem.knots, 3).toarray()
    difference = (ends[1] - ends[0]) / (end - start)
    speed = problem.base_m_s + float(difference @ coefficients)
    n = problem.n
    deviation = float(np.sqrt(difference @ covariance[:n, :n] @ difference))
    travel = Travel(
        speed, speed - 1.96 * deviation, speed + 1.96 * deviation, problem.base_m_s, spline
    )
    shift_sd, rate_sd = (float(np.sqrt(covariance[k, k])) for k in (n, n + 1))
    return Fit(travel, dict(scales), Ground(float(moved[0]), float(moved[1]), shift_sd, rate_sd))
