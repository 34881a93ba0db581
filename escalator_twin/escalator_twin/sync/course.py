"""Cycles passed as a smooth function of time, from what single stretches of a signal tell."""

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline
from scipy.stats import t as student

from escalator_twin.signals import Floats

KNOT_S = 8.0  # of the spline: the fastest wander has a period of 30 s
FASTEST_WANDER_S = 30.0
HUBER = 2.5  # robust deviations beyond which an observation counts less
LEAST_OBSERVED = 3
TWO_SIDED_95 = 0.975  # quantile of either end


@dataclass(frozen=True)
class Course:
    """Cycles passed as a smooth function of time.

    Attributes
    ----------
    mean_hz : float
        Mean frequency between the first and the last sample.
    half_width_hz : float
        Half of its 95 % interval.
    clear : bool
        The phase of at least one line keeps to the course all along.
    """

    mean_hz: float
    half_width_hz: float
    base_hz: float
    spline: BSpline
    clear: bool

    def at(self, time_s: Floats) -> Floats:
        """Return the cycles passed at ``time_s`` (n,), to within a constant."""
        knots = self.spline.t
        return self.base_hz * time_s + self.spline(np.clip(time_s, knots[0], knots[-1]))


@dataclass(frozen=True)
class Basis:
    """A cubic spline of the cycles beyond a base frequency, and the rein on its curvature.

    The rein is a prior: from site to site its slope changes by no more, in one standard
    deviation, than a wander of the stated size and a period of 30 s makes it.
    """

    knots: Floats
    rein: Floats
    ends: Floats

    @classmethod
    def over(cls, span_s: float, wander_hz: float) -> 'Basis':
        """Return the basis over [0, span]."""
        inner = np.linspace(0.0, span_s, max(2, round(span_s / KNOT_S) + 1))
        knots = np.concatenate([[0.0] * 3, inner, [span_s] * 3])
        n = len(knots) - 4
        sites = np.array([knots[i + 1 : i + 4].mean() for i in range(n)])
        slope = np.diff(np.eye(n), axis=0) / np.diff(sites)[:, None]
        change = wander_hz * 2.0 * np.pi / FASTEST_WANDER_S * 0.5 * (sites[2:] - sites[:-2])
        rein = np.diff(slope, axis=0) / change[:, None]
        at_ends = BSpline.design_matrix(np.array([0.0, span_s]), knots, 3).toarray()
        return cls(knots, rein, (at_ends[1] - at_ends[0]) / span_s)

    def at(self, time_s: Floats) -> Floats:
        """Return the basis functions (m, n) at ``time_s`` (m,) inside the span."""
        return np.asarray(BSpline.design_matrix(time_s, self.knots, 3).toarray())

    def smooth(self, design: Floats, observed: Floats, variance: Floats) -> 'Smooth':
        """Return the coefficients of ``observed = design @ coefficients``, reined."""
        weighted = design / variance[:, None]
        data = design.T @ weighted
        normal = data + self.rein.T @ self.rein
        # what nothing determines, as a common offset, stays near zero
        normal += 1e-12 * np.trace(normal) / len(normal) * np.eye(len(normal))
        covariance: Floats = np.asarray(np.linalg.inv(normal), dtype=np.float64)
        n_free = float(np.sum(covariance * data))
        return Smooth(covariance @ (weighted.T @ observed), covariance, n_free)

    def course(
        self,
        base_hz: float,
        smooth: 'Smooth',
        residual: Floats,
        clear: bool = True,
        least_hz: float = 0.0,
    ) -> Course:
        """Return the course of ``smooth``, with its interval.

        ``residual`` (b,) is in standard deviations; ``least_hz`` the least half width.
        """
        mean = base_hz + float(self.ends @ smooth.cycles)
        spread = float(np.sqrt(self.ends @ smooth.covariance @ self.ends))
        spread *= inflation(residual, smooth.n_free)
        n_more = max(len(residual) - smooth.n_free, 1.0)
        half = max(float(student.ppf(TWO_SIDED_95, n_more)) * spread, least_hz)
        return Course(mean, half, base_hz, BSpline(self.knots, smooth.cycles, 3), clear)


@dataclass(frozen=True)
class Smooth:
    """Coefficients of a basis (n,), their covariance (n, n), and how many the data settled."""

    cycles: Floats
    covariance: Floats
    n_free: float


def robust_scale(off: Floats, n_free: float) -> float:
    """Return the robust standard deviation of residuals ``off`` (n,) of ``n_free`` unknowns."""
    lost = len(off) / max(len(off) - n_free, 1.0)
    return max(1.4826 * float(np.median(np.abs(off))) * float(np.sqrt(lost)), 1e-9)


def huber_weight(off: Floats, scale: float) -> Floats:
    """Return inverse variances of observations that are ``off`` (n,) by their scale."""
    return 1.0 / np.maximum(1.0, np.abs(off) / (HUBER * scale)) / scale**2


def inflation(residual: Floats, n_free: float) -> float:
    """Return by how much the scatter of observations widens an interval.

    ``residual`` (b,) is in standard deviations; neighbours that err together count as fewer.
    """
    n = len(residual)
    power = float(residual @ residual)
    if n < LEAST_OBSERVED or not power > 0.0:
        return 1.0
    together = 1.0
    for lag in range(1, n // 3 + 1):
        share = float(residual[lag:] @ residual[:-lag]) / power
        if share <= 0.0:
            break
        together += 2.0 * share
    return float(np.sqrt(max(power / max(n - n_free, 1.0), 1.0) * together))
