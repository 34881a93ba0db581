r"""The contact law of Kwon, Park and Park, eqs. (4) to (7), after Lankarani and Nikravesh.

.. math::
    C_c &= 1/R_1 + 1/R_2  &(4) \\
    K_{nom} &= 0.733 E \sqrt{1/C_c}  &(5) \\
    F_n &= K_{nom} [1 \pm \frac{1 - C_r^2}{1 + C_r^2} \tanh(2.5 V_p / V_c)] \delta^{1.5}  &(6) \\
    F_f &= \mu_{nom} \tanh(2.5 V_t / V_c) F_n  &(7)

V_c is the transition velocity V_epsilon of the paper's nomenclature, one for each equation here.
The sign in (6) is plus while the bodies approach; the hyperbolic tangent, odd in V_p, carries it.

Where eq. (5) is true
---------------------
Hertz for two spheres is K = 4/3 E* sqrt(R), 1/E* = (1 - n1^2)/E1 + (1 - n2^2)/E2, R = 1/C_c. With
both of one material of Poisson's ratio n this is 2/3 E sqrt(R) / (1 - n^2): 0.733 E at n = 0.3. So
eq. (5) holds for point contact of two like metals. It is not true

- of a polyurethane tread on steel: the rail does not yield (E* = E / (1 - n^2), twice as stiff) and
  n is near 0.5, so that with the tread's own E eq. (5) gives 0.42 of Hertz at n = 0.48;
  `hertz_modulus` gives the E with which it gives Hertz;
- of a cylinder across a flat rail, whose force grows about linearly with depth, with its length in
  place of the root of R; a bonded tread only millimetres thick is stiffer still;
- beyond depths of about a tenth of R, and for creep, which polyurethane has.

Where eq. (6) is true: with V_p far beyond V_c the work kept is (1 - b) / (1 + b) = C_r^2 of what
came in, b the fraction in (6), as restitution wants it. Below V_c the tangent fades and the contact
turns elastic: slow impacts return with more than C_r.
"""

from math import sqrt
from typing import Literal

import numpy as np

from escalator_twin.physics.compiled import compiled
from escalator_twin.physics.contact import saturating

HERTZ_AT_03 = 0.733  # eq. (5): 2/3 / (1 - 0.3^2), rounded as printed
TO_TRANSITION = 2.5  # eqs. (6), (7)


def combined_curvature(radius_1_m: float, radius_2_m: float = np.inf) -> float:
    """Return C_c of eq. (4), 1/m; a radius is negative where a surface is hollow."""
    return 1.0 / radius_1_m + 1.0 / radius_2_m


def nominal_stiffness(elastic_modulus_pa: float, curvature_per_m: float) -> float:
    """Return K_nom of eq. (5), N/m^1.5."""
    return HERTZ_AT_03 * elastic_modulus_pa * sqrt(1.0 / curvature_per_m)


def hysteresis(restitution: float) -> float:
    """Return the fraction of eq. (6): 0 for an elastic contact, 1 for one that keeps nothing."""
    return (1.0 - restitution**2) / (1.0 + restitution**2)


def hertz_modulus(
    first: tuple[float, float], second: tuple[float, float] | Literal['rigid'] = 'rigid'
) -> float:
    """Return the E with which eq. (5) is Hertz's contact of two materials.

    Parameters
    ----------
    first, second : (modulus Pa, Poisson's ratio)
    """
    compliance = sum(
        (1.0 - ratio**2) / modulus
        for modulus, ratio in ([first] if second == 'rigid' else [first, second])
    )
    return 4.0 / 3.0 / HERTZ_AT_03 / compliance


@compiled
def secant(speed: float, share: float, steepest: float) -> float:
    """Return the slope from rest to a saturated force: what an implicit step needs of it.

    The tangent there is near zero, and a step that takes it goes through rest and beyond: bodies
    light against the force then chatter from step to step and are driven by it. With the secant
    the speed decays and keeps its sign.
    """
    return steepest if abs(speed) * steepest < 1e-6 else share / speed


@compiled
def normal_law(
    depth: float, rate: float, stiffness: float, loss: float, transition: float
) -> tuple[float, float, float]:
    """Return F_n of eq. (6) with its slope against depth and its secant against rate.

    Parameters
    ----------
    depth, rate : float
        Penetration (m), none below 0, and its rate (m/s), positive while approaching.
    stiffness : float
        K_nom.
    loss : float
        The fraction of `hysteresis`.
    transition : float
        V_c, m/s.
    """
    if depth <= 0.0:
        return 0.0, 0.0, 0.0
    share = saturating(TO_TRANSITION * rate / transition)
    root = np.sqrt(depth)
    factor = 1.0 + loss * share
    elastic = stiffness * root * depth
    damping = elastic * loss * secant(rate, share, TO_TRANSITION / transition)
    return elastic * factor, 1.5 * stiffness * root * factor, damping


@compiled
def friction_law(
    speed: float, normal: float, friction: float, transition: float
) -> tuple[float, float]:
    """Return F_f of eq. (7) with its secant against the sliding speed."""
    share = saturating(TO_TRANSITION * speed / transition)
    limit = friction * normal
    return limit * share, limit * secant(speed, share, TO_TRANSITION / transition)


@compiled
def resistance_law(
    speed: float, normal: float, law: tuple[float, float, float, float, float, float]
) -> tuple[float, float]:
    """Return a roller's drag at its tread, N, with its secant against the rolling speed.

    Dry parts, of load and of seals, saturate with speed; the load's falls with it (Stribeck).

    Parameters
    ----------
    speed : float
        Of the tread about its axle, m/s.
    normal : float
        Load, N.
    law : tuple of float
        Rolling resistance, its relative rise at rest, speed at which that fades, seals' drag in N,
        viscous coefficient in N s/m, creep speed.
    """
    resistance, rise, fading, seals, viscous, creep = law
    dry = resistance * normal
    if rise != 0.0:
        dry *= 1.0 + rise * np.exp(-abs(speed) / fading)
    dry += seals
    share = saturating(speed / creep)
    return dry * share + viscous * speed, dry * secant(speed, share, 1.0 / creep) + viscous
