"""The force law of a network and its step, compiled.

MuJoCo holds the state and integrates semi-implicitly; velocities stand at the middle of the step.
Contacts enter the step linearly implicitly, body by body; links and bushes, soft against a body's
inertia over a step, explicitly.
"""

import numpy as np

from escalator_twin.physics.compiled import compiled
from escalator_twin.physics.contact import ramp, saturating
from escalator_twin.physics.multibody import network as net
from escalator_twin.physics.multibody import segments as seg
from escalator_twin.physics.multibody.contacts import contacts, search, SEARCH_STEPS
from escalator_twin.physics.multibody.network import Memory, Network
from escalator_twin.signals import Floats

PART_CREEP_M_S = 2.0e-3  # dry friction on a part saturates as tanh(v / this), as a carriage's does


@compiled
def links(n: Network, m: Memory, q: Floats, w: Floats) -> None:
    """Add the spring-dampers between the centres of two bodies, and their bending."""
    for k in range(len(n.link)):
        i, j = n.link_ends[k, 0], n.link_ends[k, 1]
        a, b = 3 * i, 3 * j
        dx, dz = q[b] - q[a], q[b + 1] - q[a + 1]
        length = np.sqrt(dx * dx + dz * dz)
        ex, ez = dx / length, dz / length
        rate = (w[b] - w[a]) * ex + (w[b + 1] - w[a + 1]) * ez
        law = n.link[k]
        pull = law[net.L_STIFF] * (length - law[net.L_FREE]) + law[net.L_DAMP] * rate
        m.tension[k] = pull
        m.force[i, 0] += pull * ex
        m.force[i, 1] += pull * ez
        m.force[j, 0] -= pull * ex
        m.force[j, 1] -= pull * ez
        if law[net.L_BEND] != 0.0 or law[net.L_BEND_DRAG] != 0.0:
            turn = q[b + 2] - q[a + 2]
            turn -= 2.0 * np.pi * np.floor(turn / (2.0 * np.pi) + 0.5)
            moment = law[net.L_BEND] * turn
            moment += law[net.L_BEND_DRAG] * saturating(
                (w[b + 2] - w[a + 2]) / law[net.L_BEND_RATE]
            )
            m.force[i, 2] += moment
            m.force[j, 2] -= moment


@compiled
def bushes(n: Network, m: Memory, q: Floats, w: Floats) -> None:
    """Add the spring-dampers that hold a roller's centre at a place on the body that carries it."""
    for k in range(len(n.bush)):
        i, j = n.bush_ends[k, 0], n.bush_ends[k, 1]
        a, b = 3 * i, 3 * j
        cosine, sine = np.cos(q[b + 2]), np.sin(q[b + 2])
        law = n.bush[k]
        px, pz = law[0] * cosine - law[1] * sine, law[0] * sine + law[1] * cosine
        spin = w[b + 2]
        fx = law[2] * (q[b] + px - q[a]) + law[3] * (w[b] - spin * pz - w[a])
        fz = law[2] * (q[b + 1] + pz - q[a + 1]) + law[3] * (w[b + 1] + spin * px - w[a + 1])
        m.force[i, 0] += fx
        m.force[i, 1] += fz
        m.force[j, 0] -= fx
        m.force[j, 1] -= fz
        m.force[j, 2] -= px * fz - pz * fx


@compiled
def weights(n: Network, m: Memory) -> None:
    """Set the forces to the bodies' weights and loads."""
    for i in range(len(n.mass)):
        m.force[i, 0] = 0.0
        m.force[i, 1] = -n.mass[i] * n.gravity
        m.force[i, 2] = 0.0
        for c in range(6):
            m.added[i, c] = 0.0
        if n.load[i] != 0.0:
            s = m.s[n.load_point[i]]
            stretch = n.load_stretch
            m.force[i, 1] -= n.load[i] * ramp(s, stretch[0], stretch[1], stretch[2])


@compiled
def dry_drags(n: Network, m: Memory, w: Floats) -> None:
    """Add dry drag on bodies, their own and that of rough stretches, against their motion.

    It acts between a body and what it runs on: a part that carries the segment feels it, too.
    """
    base = 3 * len(n.mass)
    for c in range(len(n.point_body)):
        pull = n.drag[c, net.D_DRY]
        for k in range(len(n.stretch_drag)):
            row = n.stretch_drag[k]
            if row[0] <= m.touching[c] < row[1] and row[2] <= m.s[c] < row[3]:
                pull += row[4]
        if pull == 0.0:
            continue
        b, touched = 3 * n.point_body[c], m.touching[c]
        vx, vz = w[b], w[b + 1]
        p = int(n.segments[touched, seg.PART]) if touched >= 0 else -1
        if p >= 0:
            vx, vz = vx - w[base + p] * n.part[p, net.P_X], vz - w[base + p] * n.part[p, net.P_Z]
        speed = np.sqrt(vx**2 + vz**2)
        if speed > 0.0:
            pull *= saturating(speed / PART_CREEP_M_S) / speed
            m.force[n.point_body[c], 0] -= pull * vx
            m.force[n.point_body[c], 1] -= pull * vz
            if p >= 0:
                m.part_force[p] += pull * (vx * n.part[p, net.P_X] + vz * n.part[p, net.P_Z])


@compiled
def parts(n: Network, m: Memory, q: Floats, w: Floats, h: float) -> None:
    """Write the accelerations of the parts and of the rotors."""
    base = 3 * len(n.mass)
    for p in range(len(n.part)):
        row = n.part[p]
        here, rate = q[base + p], w[base + p]
        push = row[net.P_PUSH] - row[net.P_STIFF] * here - row[net.P_DAMP] * rate
        mass = row[net.P_MASS] + h * row[net.P_DAMP] + m.part_added[p]
        if row[net.P_FRICTION] > 0.0:
            share = saturating(rate / PART_CREEP_M_S)
            push -= row[net.P_FRICTION] * share
            mass += h * row[net.P_FRICTION] * (1.0 - share * share) / PART_CREEP_M_S
        if here > row[net.P_STOP]:
            stop = row[net.P_STOP_STIFF] * (here - row[net.P_STOP]) + row[net.P_STOP_DAMP] * rate
            if stop > 0.0:
                push -= stop
                mass += h * row[net.P_STOP_DAMP] + 0.25 * h * h * row[net.P_STOP_STIFF]
        m.acceleration[base + p] = (push + m.part_force[p]) / mass
    base += len(n.part)
    for r in range(len(n.rotor)):
        target = m.clock[2] * n.rotor[r, net.R_SPEED]
        m.acceleration[base + r] = (target - m.rotor[r, 1]) / h


@compiled
def solve(n: Network, m: Memory) -> None:
    """Write the bodies' accelerations: force over mass and what contacts add, 3 by 3."""
    for i in range(len(n.mass)):
        mass, inertia = n.mass[i], n.inertia[i]
        fx, fz, fa = m.force[i, 0], m.force[i, 1], m.force[i, 2]
        k = m.added[i]
        j = 3 * i
        if k[0] == 0.0 and k[3] == 0.0 and k[5] == 0.0:
            m.acceleration[j], m.acceleration[j + 1] = fx / mass, fz / mass
            m.acceleration[j + 2] = fa / inertia
            continue
        # Cholesky, L D L'
        d0 = mass + k[0]
        l1, l2 = k[1] / d0, k[2] / d0
        d1 = mass + k[3] - l1 * k[1]
        e = k[4] - l2 * k[1]
        l3 = e / d1
        d2 = inertia + k[5] - l2 * k[2] - l3 * e
        y1 = fz - l1 * fx
        y2 = fa - l2 * fx - l3 * y1
        aa = y2 / d2
        az = y1 / d1 - l3 * aa
        m.acceleration[j] = fx / d0 - l1 * az - l2 * aa
        m.acceleration[j + 1] = az
        m.acceleration[j + 2] = aa


@compiled
def accelerations(n: Network, m: Memory, q: Floats, w: Floats, h: float) -> None:
    """Evaluate the law at ``q`` with mid-step velocity ``w``; fill ``m.acceleration``."""
    if m.clock[1] <= 0.0:
        points = n.point_body, n.point_offset, n.point_rows
        search(q, n.segments, n.part, 3 * len(n.mass), points, m.near)
        m.clock[1] = SEARCH_STEPS
    m.clock[1] -= 1.0
    for r in range(len(n.rotor)):
        m.torque[r] = 0.0
    for p in range(len(n.part)):
        m.part_force[p] = m.part_added[p] = 0.0
    weights(n, m)
    links(n, m, q, w)
    bushes(n, m, q, w)
    contacts(n, m, q, w, h)
    dry_drags(n, m, w)
    parts(n, m, q, w, h)
    solve(n, m)
