"""Bias and small rotation of an acceleration sensor, found from what it should read."""

import numpy as np
from scipy.spatial.transform import Rotation

from escalator_twin.errors import RecordingError
from escalator_twin.metrics.filters import bridge, lowpass, Mask, thinning
from escalator_twin.metrics.track import LOW_HZ
from escalator_twin.signals import Floats

ROUNDS = 4  # of linear least squares; the second already ends a rotation of 4 degrees
# weight of "no bias, no rotation" against one sample's equation: decides only what the
# samples leave open, as bias against tilt at standstill
PRIOR_WEIGHT = 1e-4
FIT_SAMPLES = 20.0  # per period of the low-pass that the fit keeps


def remove_sensor_pose(
    measured_xyz: Floats, simulated_xyz: Floats, rate_hz: float, valid: Mask | None = None
) -> tuple[Floats, Floats, Floats]:
    """Turn a sensor's readings back into the frame of its body.

    A sensor turned by the small right-hand rotation vector w, with bias b, reads
    m = R(w)^T a + b, to first order a - w x a + b. Both are found by linear least squares of
    m against the simulated a, signals low-passed at 2 Hz, repeated about the last estimate.

    Parameters
    ----------
    measured_xyz : (n, 3) float64
        Specific force as read, m/s2; a column of NaN where an axis is missing.
    simulated_xyz : (n, 3) float64
        Specific force in the frame of the body at the same instants, m/s2.
    rate_hz : float
        Rate of both, Hz.
    valid : (n,) bool, optional
        Samples that count.

    Returns
    -------
    corrected : (n, 3) float64
        Readings less bias, turned back, m/s2; a missing axis stays NaN, its part in the others
        is taken from the simulation.
    bias : (3,) float64
        m/s2; 0 for a missing axis.
    rotation_deg : (3,) float64
        Rotation vector of the sensor in the body's frame, right-hand, degrees.
    """
    if measured_xyz.ndim != 2 or measured_xyz.shape[1] != 3:
        raise RecordingError(f'acceleration: expected (n, 3), found {measured_xyz.shape}')
    axes: Mask = np.asarray(np.isfinite(measured_xyz).any(axis=0))
    columns = np.column_stack([measured_xyz[:, axes], simulated_xyz])
    real: Mask = np.asarray(np.isfinite(columns).all(axis=1))
    if valid is not None:
        real = real & valid
    if not axes.any() or not real.any():
        return measured_xyz.copy(), np.zeros(3), np.zeros(3)
    simulated = _low(simulated_xyz, real, rate_hz)
    measured = np.where(axes, _low(measured_xyz, real, rate_hz), 0.0)
    step = thinning(rate_hz, FIT_SAMPLES * LOW_HZ)
    chosen = slice(None, None, step) if real[::step].any() else slice(None)
    thin: Mask = np.asarray(real[chosen])
    rotation, bias = _fit(measured[chosen][thin], simulated[chosen][thin], axes)
    readings = np.where(axes, measured_xyz, rotation.inv().apply(simulated_xyz) + bias)
    corrected = rotation.apply(readings - bias)
    corrected[:, ~axes] = np.nan
    return corrected, bias, rotation.as_rotvec(degrees=True)


def _low(rows: Floats, real: Mask, rate_hz: float) -> Floats:
    """Return the columns of ``rows`` (n, 3) bridged and low-passed."""
    columns = [lowpass(bridge(column, real), LOW_HZ, rate_hz) for column in rows.T]
    return np.stack(columns, axis=1)


def _fit(measured: Floats, simulated: Floats, axes: Mask) -> tuple[Rotation, Floats]:
    """Return the sensor's rotation and bias from readings (n, 3) and what they should be."""
    rotation = Rotation.identity()
    bias = np.zeros(3)
    for _ in range(ROUNDS):
        turned = rotation.inv().apply(simulated)
        step, bias = _linear_step(measured, turned, axes)
        # the step turns the sensor about its own axes
        rotation = rotation * Rotation.from_rotvec(step)
    return rotation, bias


def _linear_step(measured: Floats, turned: Floats, axes: Mask) -> tuple[Floats, Floats]:
    """Solve m - a = a x w + b for w and b, over the axes that are there."""
    normal = np.diag(np.full(6, PRIOR_WEIGHT))
    right = np.zeros(6)
    x, y, z = turned.T
    zero = np.zeros(len(turned))
    # rows of the cross-product matrix of a
    cross = ((zero, -z, y), (z, zero, -x), (-y, x, zero))
    for axis in np.flatnonzero(axes):
        ones = np.zeros((len(turned), 3))
        ones[:, axis] = 1.0
        design = np.column_stack([*cross[axis], ones])
        normal += design.T @ design
        right += design.T @ (measured[:, axis] - turned[:, axis])
    solution = np.linalg.solve(normal, right)
    return np.asarray(solution[:3]), np.asarray(solution[3:])
