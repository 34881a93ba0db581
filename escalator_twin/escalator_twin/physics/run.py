"""The compiled loop: force law, MuJoCo step, record."""

import numba
import numpy as np

from escalator_twin.physics.kernel import accelerations, rack_speed
from escalator_twin.physics.mjcall import call_step

# What a recorded column is; the index columns follow in ``Probe`` rows: (kind, index, side).
LINK_FORCE, ROLLER_NORMAL, CARRIAGE, ACCEL_X, ACCEL_Y, ACCEL_Z, PLACE, RACK = range(8)


@numba.njit(cache=True)
def read_probe(p, state, q, out, kind, index, side, base):
    """Return one recorded quantity at the present step, SI."""
    m, n = state.s.shape
    stride = 1 + 2 * m
    row = side if m == 2 else 0
    share = 1.0 if m == 2 else 0.5
    if kind == LINK_FORCE:
        return share * state.tension[row, index]
    if kind == ROLLER_NORMAL:
        return share * state.normal[row, index]
    if kind == CARRIAGE:
        return q[0]
    if kind == PLACE:
        s, other = state.s[0, index], state.s[m - 1, index]
        half = 0.5 * p.length_m
        return (s + 0.5 * ((other - s + half) % p.length_m - half)) % p.length_m
    if kind == RACK:
        return state.rack[0]
    k = index + 1 if index + 1 < n else 0
    i, j = base + index * stride, base + k * stride
    if kind == ACCEL_Y:
        return 0.5 * (out[i] + out[j])
    ax, az, ex, ez = 0.0, p.gravity, 0.0, 0.0
    for c in range(m):
        ax += (out[i + 1 + 2 * c] + out[j + 1 + 2 * c]) / (2.0 * m)
        az += (out[i + 2 + 2 * c] + out[j + 2 + 2 * c]) / (2.0 * m)
        ex += state.direction[c, index, 0]
        ez += state.direction[c, index, 1]
    length = np.sqrt(ex * ex + ez * ez)
    if kind == ACCEL_X:
        return (ax * ex + az * ez) / length
    return (az * ex - ax * ez) / length


@numba.njit(cache=True, nogil=True)
def advance(
    p, state, q, w, applied, mass, heights, h, n_steps, stride, probes, record, step, model, data
):
    """Run ``n_steps`` steps of ``h`` seconds; record every ``stride``-th from the first on.

    Parameters
    ----------
    p, state : Parameters, State
    q, w, applied : (nv,) float64
        Views of MuJoCo's ``qpos``, ``qvel`` and ``qfrc_applied``.
    mass : (nv,) float64
        Diagonal of MuJoCo's mass matrix.
    heights : (nv,) float64
        1 where a coordinate is vertical: MuJoCo takes gravity from there.
    probes : (k, 3) int64
    record : (n, k) float64
    step, model, data : int
        Addresses for MuJoCo's step.

    Returns
    -------
    rows : int
        Rows of ``record`` that were written.
    """
    base = 2 if p.frame[0] > 0.0 else 1
    v, out = np.zeros(len(q)), np.zeros(len(q))
    rows = 0
    for k in range(n_steps):
        accelerations(p, state, q, w, v, h, out)
        if k % stride == 0 and rows < len(record):
            for c in range(len(probes)):
                record[rows, c] = read_probe(
                    p, state, q, out, probes[c, 0], probes[c, 1], probes[c, 2], base
                )
            rows += 1
        for i in range(len(q)):
            applied[i] = mass[i] * (out[i] + heights[i] * p.gravity)
        call_step(step, model, data)
        way = h * rack_speed(p, state)
        state.rack[0] += way
        state.rack[1] += h
        for side in range(state.s.shape[0]):
            for i in range(state.s.shape[1]):
                state.roll[side, i] += h * state.speed[side, i]
    return rows


@numba.njit(cache=True)
def relax(p, state, q, w, h, n_steps, rate):
    """Let the machine come to rest at a fixed rack, all rollers dragged as if they moved.

    Mass-proportional damping of ``rate`` (1/s) is laid over the same law; MuJoCo is not needed,
    since only the state of rest is kept.

    Returns
    -------
    residual : float
        Largest speed at the end, m/s.
    """
    v, out = np.zeros(len(q)), np.zeros(len(q))
    keep = 1.0 - h * rate
    worst = 0.0
    for k in range(n_steps):
        accelerations(p, state, q, w, v, h, out)
        worst = 0.0
        for i in range(len(q)):
            w[i] = keep * w[i] + h * out[i]
            q[i] += h * w[i]
            worst = max(worst, abs(w[i]))
        if worst < 1e-7 and k > 10:
            break
    return worst
