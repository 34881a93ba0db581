"""Standard scores of model validation, of two signals whose means are removed."""

import numpy as np

from escalator_twin.metrics.agreement import Products
from escalator_twin.metrics.filters import centred
from escalator_twin.signals import Floats


def sprague_geers(products: Products) -> dict[str, float | None]:
    """Return magnitude, phase and comprehensive error of Sprague and Geers, unitless.

    M = sqrt(ss / mm) - 1, P = arccos(ms / sqrt(mm ss)) / pi, C = sqrt(M**2 + P**2), with
    mm, ss and ms the mean products (Sprague and Geers 2003; Schwer 2007, eq. 3 to 6). All
    are 0 for equal signals; M keeps its sign, positive where the simulation is larger.
    Keys ``magnitude``, ``phase``, ``comprehensive``; ``None`` where one signal is constant.
    """
    cosine = products.correlation
    if cosine is None:
        return dict.fromkeys(('magnitude', 'phase', 'comprehensive'))
    magnitude = float(np.sqrt(products.simulated / products.measured)) - 1.0
    phase = float(np.arccos(cosine) / np.pi)
    comprehensive = float(np.hypot(magnitude, phase))
    return {'magnitude': magnitude, 'phase': phase, 'comprehensive': comprehensive}


def theil(products: Products) -> dict[str, float | None]:
    """Return Theil's inequality coefficient and its shares of variance and covariance.

    U = rms(m - s) / (rms(m) + rms(s)), 0 for equal and 1 for opposite signals; of the mean
    squared difference, (sd(s) - sd(m))**2 is the share of variance and
    2 (1 - r) sd(s) sd(m) that of covariance (Theil 1966, ch. 2). With means removed there
    is no share of bias. Keys ``coefficient``, ``variance``, ``covariance``; ``None`` where both
    signals are constant; the shares are 0 for equal signals.
    """
    rms_m, rms_s = np.sqrt(products.measured), np.sqrt(products.simulated)
    if not rms_m + rms_s > 0.0:
        return dict.fromkeys(('coefficient', 'variance', 'covariance'))
    coefficient = float(np.sqrt(products.difference) / (rms_m + rms_s))
    if products.difference == 0.0:
        return {'coefficient': coefficient, 'variance': 0.0, 'covariance': 0.0}
    variance = float(np.clip((rms_s - rms_m) ** 2 / products.difference, 0.0, 1.0))
    return {'coefficient': coefficient, 'variance': variance, 'covariance': 1.0 - variance}


def area_metric(measured: Floats, simulated: Floats) -> float | None:
    """Return the area between the two empirical distributions, in measured deviations.

    The integral of |F_s(x) - F_m(x)| dx (Ferson, Oberkampf and Ginzburg 2008, eq. 8), which
    for samples of equal number is the mean difference of the sorted ones, over the measured
    standard deviation; blind to when a value occurs. ``None`` where the measured signal is
    constant.
    """
    if len(measured) < 2:
        return None
    m = centred(measured)
    deviation = float(np.sqrt(np.mean(m * m)))
    if not deviation > 0.0:
        return None
    return float(np.mean(np.abs(np.sort(centred(simulated)) - np.sort(m))) / deviation)
