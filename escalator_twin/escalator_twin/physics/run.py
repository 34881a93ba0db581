"""The compiled loop: force law, MuJoCo's integration, record."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from escalator_twin.physics.compiled import compiled, inlined
from escalator_twin.physics.contact import rack_speed
from escalator_twin.physics.kernel import accelerations
from escalator_twin.physics.mjcall import call_step
from escalator_twin.physics.parameters import Parameters
from escalator_twin.physics.rails import Rails
from escalator_twin.physics.state import State, TIME, TRAVEL
from escalator_twin.signals import Floats

# What a recorded column is; the index columns follow in rows of probes: (kind, index, side).
LINK_FORCE, ROLLER_NORMAL, CARRIAGE, ACCEL_X, ACCEL_Y, ACCEL_Z, PLACE, RACK, FRAME = range(9)
EVERYTHING = 9  # a single probe: one row holds all that ``read_all`` writes


class Host(NamedTuple):
    """MuJoCo's model and data as compiled code sees them; arrays of (nv,) are views."""

    q: Floats  # qpos
    w: Floats  # qvel
    acceleration: Floats  # qacc
    applied: Floats  # qfrc_applied
    mass: Floats  # diagonal of the mass matrix
    weight: Floats  # what MuJoCo's gravity takes from each coordinate, N
    step: int  # addresses: of the function that steps, of mjModel, of mjData
    model: int
    data: int


@inlined
def middle_of(s: float, other: float, length_m: float) -> float:
    """Return the place in the loop between two that are near each other, m."""
    half = 0.5 * length_m
    apart = other - s
    if apart >= half:
        apart -= length_m
    elif apart < -half:
        apart += length_m
    middle = s + 0.5 * apart
    if middle >= length_m:
        middle -= length_m
    elif middle < 0.0:
        middle += length_m
    return middle


@compiled
def read_probe(p: Parameters, state: State, q: Floats, kind: int, index: int, side: int) -> float:
    """Return one recorded quantity at the present step, SI."""
    out, base = state.acceleration, len(state.reaction)
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
        return middle_of(state.s[0, index], state.s[m - 1, index], p.length_m)
    if kind == RACK:
        return state.rack[TRAVEL]
    if kind == FRAME:
        return state.reaction[base - 1]
    k = index + 1 if index + 1 < n else 0
    i, j = base + index * stride, base + k * stride
    if kind == ACCEL_Y:
        return 0.5 * (out[i] + out[j])
    ax, az, ex, ez = 0.0, p.gravity, 0.0, 0.0
    for c in range(m):
        ax += (out[i + 1 + 2 * c] + out[j + 1 + 2 * c]) / (2.0 * m)
        az += (out[i + 2 + 2 * c] + out[j + 2 + 2 * c]) / (2.0 * m)
        ex += state.direction[0, c, index]
        ez += state.direction[1, c, index]
    length = np.sqrt(ex * ex + ez * ez)
    if kind == ACCEL_X:
        return (ax * ex + az * ez) / length
    return (az * ex - ax * ez) / length


def width_of(probes: NDArray[np.int64], n_links: int) -> int:
    """Return how many columns a record with these probes has."""
    is_all = len(probes) == 1 and probes[0, 0] == EVERYTHING
    return 4 + 6 * n_links if is_all else len(probes)


@compiled
def read_all(p: Parameters, state: State, q: Floats, row: Floats) -> None:
    """Write place of axle 0, rack's travel, carriage, all links and the steps' accelerations.

    In this order: place, travel, carriage, tensions of the left links, of the right, accelerations along
    x of all steps, along y, along z, places of all axles, the way that the rollers of axle 0 rolled.
    """
    out, base = state.acceleration, len(state.reaction)
    m, n = state.s.shape
    stride = 1 + 2 * m
    share = 1.0 if m == 2 else 0.5
    row[1] = state.rack[TRAVEL]
    row[2] = q[0]
    for i in range(n):
        row[3 + 5 * n + i] = middle_of(state.s[0, i], state.s[m - 1, i], p.length_m)
        k = i + 1 if i + 1 < n else 0
        a, b = base + i * stride, base + k * stride
        row[3 + i] = share * state.tension[0, i]
        row[3 + n + i] = share * state.tension[m - 1, i]
        ax, az, ex, ez = 0.0, p.gravity, 0.0, 0.0
        for c in range(m):
            ax += (out[a + 1 + 2 * c] + out[b + 1 + 2 * c]) / (2.0 * m)
            az += (out[a + 2 + 2 * c] + out[b + 2 + 2 * c]) / (2.0 * m)
            ex += state.direction[0, c, i]
            ez += state.direction[1, c, i]
        length = np.sqrt(ex * ex + ez * ez)
        row[3 + 2 * n + i] = (ax * ex + az * ez) / length
        row[3 + 3 * n + i] = 0.5 * (out[a] + out[b])
        row[3 + 4 * n + i] = (az * ex - ax * ez) / length
    row[0] = row[3 + 5 * n]
    row[3 + 6 * n] = 0.5 * (state.roll[0, 0] + state.roll[m - 1, 0])


@compiled
def advance(
    p: Parameters, rails: Rails, state: State, host: Host, h: float, n_steps: int, stride: int,
    probes: NDArray[np.int64], record: Floats,
) -> None:  # fmt: skip
    """Run ``n_steps`` steps of ``h`` seconds; record every ``stride``-th from the first on."""
    q, w, acceleration, applied = host.q, host.w, host.acceleration, host.applied
    mass, weight, rack, roll, speed = host.mass, host.weight, state.rack, state.roll, state.speed
    out, v = state.acceleration, state.velocity
    for k in range(n_steps):
        accelerations(p, rails, state, q, w, v, h)
        if k % stride == 0 and len(probes) == 1 and probes[0, 0] == EVERYTHING:
            read_all(p, state, q, record[k // stride])
        elif k % stride == 0:
            for c in range(len(probes)):
                record[k // stride, c] = read_probe(
                    p, state, q, probes[c, 0], probes[c, 1], probes[c, 2]
                )
        for i in range(len(q)):
            acceleration[i] = out[i]
            applied[i] = mass[i] * out[i] + weight[i]
        call_step(host.step, host.model, host.data)
        move_rack(p, rack, h)
        for side in range(speed.shape[0]):
            for i in range(speed.shape[1]):
                roll[side, i] += h * speed[side, i]


@compiled
def move_rack(p: Parameters, rack: Floats, h: float) -> None:
    """Move the rack on by one step, by its speed in the middle of the step."""
    rack[TRAVEL] += 0.5 * h * p.speed
    rack[TIME] += 0.5 * h
    speed = rack_speed(p.speed, p.pitch_m, p.ripple, p.hunting, p.lateness, p.lateness_step, rack)
    rack[TRAVEL] += h * (speed - 0.5 * p.speed)
    rack[TIME] += 0.5 * h


@compiled
def relax(
    p: Parameters,
    rails: Rails,
    state: State,
    q: Floats,
    w: Floats,
    h: float,
    n_steps: int,
    rate: float,
    still: float,
) -> float:
    """Let the machine come to rest at a fixed rack, all rollers dragged as if they moved.

    Mass-proportional damping of ``rate`` (1/s) is laid over the same law; MuJoCo is not needed,
    since only the state of rest is kept. It is at rest where nothing moves at ``still`` (m/s).

    Returns
    -------
    residual : float
        Largest speed at the end, m/s.
    """
    v, out = state.velocity, state.acceleration
    keep = 1.0 - h * rate
    worst = 0.0
    for k in range(n_steps):
        accelerations(p, rails, state, q, w, v, h)
        worst = 0.0
        for i in range(len(q)):
            w[i] = keep * w[i] + h * out[i]
            q[i] += h * w[i]
            worst = max(worst, abs(w[i]))
        if worst < still and k > 10:
            break
    return worst
