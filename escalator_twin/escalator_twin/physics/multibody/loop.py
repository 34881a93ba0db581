"""The compiled loop: force law, MuJoCo's integration, record; and how a network comes to rest."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from escalator_twin.physics.compiled import compiled
from escalator_twin.physics.mjcall import call_step
from escalator_twin.physics.multibody import segments as seg
from escalator_twin.physics.multibody.forces import accelerations
from escalator_twin.physics.multibody.network import Memory, Network
from escalator_twin.signals import Floats

# What a recorded column is; probes are rows (kind, index, sub-index).
(LINK_TENSION, POINT_NORMAL, PART_WAY, ACCEL_X, ACCEL_Z, POINT_PLACE, TORQUE, LINK_MEAN,
 POINT_SPEED, ROTOR_ANGLE, BODY_SPEED, TENSION_AT, SPEED_AT) = range(13)  # fmt: skip


class Host(NamedTuple):
    """MuJoCo's model and data as compiled code sees them; arrays are views."""

    q: Floats
    w: Floats
    acceleration: Floats
    step: int
    model: int
    data: int


@compiled
def read_probe(n: Network, m: Memory, q: Floats, w: Floats, probe: NDArray[np.int64]) -> float:
    """Return one recorded quantity at the present step, SI."""
    kind, i, j = probe[0], probe[1], probe[2]
    if kind == LINK_TENSION:
        return m.tension[i]
    if kind == POINT_NORMAL:
        return m.normal[i]
    if kind == PART_WAY:
        return q[3 * len(n.mass) + i]
    if kind == POINT_PLACE:
        return m.s[i]
    if kind == TORQUE:
        return m.torque[i]
    if kind == POINT_SPEED:
        return m.speed[i]
    if kind == ROTOR_ANGLE:
        return m.rotor[i, 0]
    if kind == BODY_SPEED:
        return np.sqrt(w[3 * i] ** 2 + w[3 * i + 1] ** 2)
    if kind == LINK_MEAN:
        return m.tension[i:j].mean()
    if kind in (TENSION_AT, SPEED_AT):
        return passing(n, m, i, j, kind == TENSION_AT)
    ax, az = m.acceleration[3 * i], m.acceleration[3 * i + 1] + n.gravity
    c, s = np.cos(q[3 * i + 2]), np.sin(q[3 * i + 2])
    return ax * c + az * s if kind == ACCEL_X else az * c - ax * s


@compiled
def passing(n: Network, m: Memory, first: int, row: int, is_tension: bool) -> float:
    """Return tension, or speed, of a belt where a segment begins.

    ``first`` is the belt's first contact point; its bodies have two points each and are the last
    ones of the network. Between two links, or two bodies, it runs linearly.
    """
    bodies = (len(n.point_body) - first) // 2
    link = len(n.link) - bodies
    place = n.segments[row, seg.START]
    for k in range(bodies):
        after = k + 1 if k + 1 < bodies else 0
        here = 0.5 * (m.s[first + 2 * k] + m.s[first + 2 * k + 1]) - place
        there = 0.5 * (m.s[first + 2 * after] + m.s[first + 2 * after + 1]) - place
        if not (here <= 0.0 < there) or there - here > 1.0:
            continue
        share = -here / (there - here)
        if not is_tension:
            a, b = first + 2 * k, first + 2 * after
            return 0.5 * (
                (1.0 - share) * (m.speed[a] + m.speed[a + 1])
                + share * (m.speed[b] + m.speed[b + 1])
            )
        # the middle of link k is half way between the two bodies
        other = after if share > 0.5 else (k - 1 if k > 0 else bodies - 1)
        near = 1.0 - abs(share - 0.5)
        return near * m.tension[link + k] + (1.0 - near) * m.tension[link + other]
    return 0.0


@compiled
def advance(
    n: Network, m: Memory, host: Host, h: float, n_steps: int, stride: int,
    probes: NDArray[np.int64], record: Floats, ramp_s: float,
) -> None:  # fmt: skip
    """Run ``n_steps`` steps of ``h`` seconds and record a row for every ``stride`` of them.

    A row holds means over its steps, as an instrument's filter leaves them; places and angles,
    which jump once a turn, are those at the middle. With ``ramp_s`` above 0, the rotors come to
    their speeds along half a cosine of that length.
    """
    rotors = len(host.q) - len(n.rotor)
    for k in range(n_steps):
        if ramp_s > 0.0:
            part = min(m.clock[0] / ramp_s, 1.0)
            m.clock[2] = 0.5 * (1.0 - np.cos(np.pi * part))
        accelerations(n, m, host.q, host.w, h)
        row = k // stride
        count = min(stride, n_steps - row * stride)
        for c in range(len(probes)):
            if probes[c, 0] != POINT_PLACE and probes[c, 0] != ROTOR_ANGLE:
                record[row, c] += read_probe(n, m, host.q, host.w, probes[c]) / count
            elif k % stride == count // 2:
                record[row, c] = read_probe(n, m, host.q, host.w, probes[c])
        for i in range(len(host.q)):
            host.acceleration[i] = m.acceleration[i]
        call_step(host.step, host.model, host.data)
        for r in range(len(n.rotor)):
            m.rotor[r, 1] = host.w[rotors + r]
            m.rotor[r, 0] = host.q[rotors + r]
        m.clock[0] += h


@compiled
def relax(
    n: Network, m: Memory, q: Floats, w: Floats, h: float, n_steps: int, rate: float
) -> float:
    """Let a network come to rest, rotors held; return its largest speed at the end, m/s.

    Mass-proportional damping of ``rate`` (1/s) is laid over the same law; MuJoCo is not needed,
    since only the state of rest is kept.
    """
    keep, worst = 1.0 - h * rate, 0.0
    moving = 3 * len(n.mass) + len(n.part)
    for _ in range(n_steps):
        accelerations(n, m, q, w, h)
        worst = 0.0
        for i in range(moving):
            w[i] = keep * w[i] + h * m.acceleration[i]
            q[i] += h * w[i]
            if i >= 3 * len(n.mass) or i % 3 != 2:
                worst = max(worst, abs(w[i]))
    return worst
