"""Rolling resistance at several speeds: one factor for all, or a law of speed.

One recording says how hard its rollers roll at its own speed, as a tolerance or as an effect; the same
machine at another speed tells ``friction_speed`` from ``rolling_resistance``. The factors of all
recordings are compared with a constant and with the law

    r (1 + rise exp(-v / speed)),

r the machine's own resistance, known to its tolerance. Two speeds tell two of these three numbers: ``speed``
is taken from the cause's reference, within a factor of two (one standard deviation, an assumption), and what that
leaves open is in the interval of ``rise``.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import exp, log

import numpy as np
from scipy import linalg, optimize

from escalator_twin.causes.registry import KNOWN
from escalator_twin.diagnosis.context import Beside
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.verdict import PER_NUMBER, PRIOR_EFFECT
from escalator_twin.signals import Floats

KNOB = 'roller.rolling_resistance'
REFERENCE = KNOWN['friction_speed'].references[0]
SPEED_SPREAD = log(2.0)  # of the logarithm of the law's speed, one standard deviation
APART = 1.3  # ratio of the fastest to the slowest, from which speeds are two
LEAST_SEEN = 0.25  # of the prior's precision: below it a recording says nothing
LEAST_RISE = 3.0 * (
    KNOWN['friction_speed'].sizes[0].tolerance or 0.0
)  # contracts.md: three tolerances
# How far a recording's factor is off beyond what it says of itself: what is thought before any was seen, and as how many
# recordings that counts.
SCATTER, COUNTS_AS = 0.03, 2.0


@dataclass(frozen=True)
class Rolled:
    """How hard rollers roll in one recording: times the described machine's resistance."""

    speed_m_s: float
    factor: float
    sd: float


@dataclass(frozen=True)
class Law:
    """The law of speed beside one factor for all speeds.

    Attributes
    ----------
    own : float
        The machine's own resistance, times the described one's.
    rise, speed_m_s : float
    sd : mapping
        Of ``rise`` and ``speed_m_s``.
    evidence : float
        Nats for the law against the better of a tolerance and ``rolling_resistance``.
    gain : (n,) float64
        By how much the law of the other recordings foretells each one better than their
        constant does, chi squared.
    """

    own: float
    rise: float
    speed_m_s: float
    sd: Mapping[str, float]
    evidence: float
    gain: Floats


def rolled(
    place: Beside, effects: Sequence[tuple[Proposal, Mapping[str, float]]]
) -> Rolled | None:
    """Return what a recording alone says of its rollers; None where it says nothing.

    Parameters
    ----------
    place : Beside
        The recording beside all that is known of it.
    effects : sequence of (Proposal, standard deviations)
        That ``place`` holds.
    """
    speed = place.stage.setting.experiment.set_speed_m_s
    for effect, sd in effects:
        if effect.cause == 'rolling_resistance' and sd.get('factor', 0.0) > 0.0:
            return Rolled(speed, effect.parameters['factor'], sd['factor'])
    names = place.stage.nuisance.names
    if KNOB not in names:
        return None
    k, fitted = names.index(KNOB), place.fitted
    unit = np.zeros(len(names))
    unit[k] = 1.0
    variance = float(linalg.cho_solve((fitted.factor, True), unit)[k])
    seen = 1.0 / variance - 1.0  # the prior taken off: all recordings share it
    if seen < LEAST_SEEN:
        return None
    turned = float(fitted.offset[k] + fitted.sizes[k])
    one = place.stage.tolerances[KNOB]
    return Rolled(speed, 1.0 + one * turned / (variance * seen), one * seen**-0.5)


def law_of(rows: Sequence[Rolled], tolerance: float) -> Law | None:
    """Fit the law of speed to several recordings of one machine; None with one speed.

    Parameters
    ----------
    rows : sequence of Rolled
    tolerance : float
        Of the machine's own resistance, one standard deviation.
    """
    speeds = np.array([row.speed_m_s for row in rows])
    if len(rows) < 2 or speeds.max() < APART * speeds.min():
        return None
    factors = np.array([row.factor for row in rows])
    own = np.array([row.sd for row in rows])
    middle = log(REFERENCE['speed_m_s'])
    starts = [np.array([1.0, rise, middle]) for rise in (0.0, REFERENCE['rise'])]
    first, _, _ = _fitted(speeds, factors, np.hypot(own, SCATTER), tolerance, starts)
    sd = np.hypot(own, _scatter(factors - _law(first, speeds)))
    found, covariance, squares = _fitted(speeds, factors, sd, tolerance, [first])
    constant = min(
        _constant(factors, sd, tolerance)[1],
        _constant(factors, sd, np.inf)[1] + 2.0 * (PRIOR_EFFECT + PER_NUMBER),
    )
    speed = exp(found[2])
    gain = np.empty(len(rows))
    for k in range(len(rows)):
        rest = np.arange(len(rows)) != k
        level, _ = _constant(factors[rest], sd[rest], np.inf)
        others, _, _ = _fitted(speeds[rest], factors[rest], sd[rest], tolerance, [found])
        foretold = np.array([level, _law(others, speeds[k])])
        plain, by_law = ((factors[k] - foretold) / sd[k]) ** 2
        gain[k] = plain - by_law
    return Law(
        float(found[0]),
        float(found[1]),
        speed,
        {
            'rise': float(covariance[1, 1] ** 0.5),
            'speed_m_s': speed * float(covariance[2, 2] ** 0.5),
        },
        0.5 * (constant - squares) - PRIOR_EFFECT - PER_NUMBER,
        gain,
    )


def _scatter(rest: Floats) -> float:
    """Return how far recordings are from the law, (n,), as one standard deviation."""
    free = max(len(rest) - 2, 0)  # two of the law's numbers are told by the recordings
    squares = COUNTS_AS * SCATTER**2 + float(rest @ rest) * free / len(rest)
    return float(np.sqrt(squares / (COUNTS_AS + free)))


def _law(numbers: Floats, speeds: Floats | float) -> Floats:
    own, rise, logarithm = numbers
    law: Floats = own * (1.0 + rise * np.exp(-speeds / exp(logarithm)))
    return law


def _fitted(
    speeds: Floats, factors: Floats, sd: Floats, tolerance: float, starts: Sequence[Floats]
) -> tuple[Floats, Floats, float]:
    """Return own, rise and log speed, their covariance, and the squares at the optimum."""
    middle = log(REFERENCE['speed_m_s'])

    def rest(numbers: Floats) -> Floats:
        prior = [(numbers[0] - 1.0) / tolerance, (numbers[2] - middle) / SPEED_SPREAD]
        return np.concatenate([(factors - _law(numbers, speeds)) / sd, prior])

    done = min((optimize.least_squares(rest, start) for start in starts), key=lambda d: d.cost)
    covariance: Floats = np.linalg.pinv(done.jac.T @ done.jac)
    return done.x, covariance, 2.0 * float(done.cost)


def _constant(factors: Floats, sd: Floats, tolerance: float) -> tuple[float, float]:
    """Return one factor for all, near 1 by its tolerance, and the squares at the optimum."""
    weights = sd**-2.0
    own = tolerance**-2.0
    level = float((weights @ factors + own) / (weights.sum() + own))
    return level, float(weights @ (factors - level) ** 2 + own * (level - 1.0) ** 2)
