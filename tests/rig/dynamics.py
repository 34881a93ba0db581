"""Equations of motion in guide coordinates, compiled.

State of an axle end: path coordinate ``s``, offset ``n`` to the left, and the components
``vt``, ``vn`` of its absolute velocity along the guide's tangent and normal.  With curvature
``k`` of the segment and the guide at rest::

    s' = vt / (1 - k n)      vt' = Ft / m + k s' vn      vn' = Fn / m - k s' vt      n' = vn

The last terms are the Coriolis and centrifugal ones.  On the lower turnaround, which the
carriage moves by ``u`` towards -x, ``s'`` and ``n'`` take the velocity relative to it.

The state is one flat vector: s, n, vt, vn of the 2 N axle ends (left, then right), lateral
offset and rate of the N axles, then carriage displacement and rate, rack travel, and the
frame mode's displacement and rate.
"""

import math

from rig.forcing import carriage_rates, drive_forces, load_forces, rack_speed
from rig.kernel import kernel
from rig.layout import (
    CARRIED,
    COS,
    FN,
    FT,
    FX,
    FZ,
    KAPPA,
    LAPS,
    MODE,
    MODE_RATE,
    NORMAL,
    RACK,
    S_DESIGN,
    S_RATE,
    SEGMENT,
    SIN,
    TENSION,
    U,
    U_RATE,
    VX,
    VZ,
    X,
    Z,
)


@kernel
def place(model, y, marks, work):
    """Fill positions, directions and velocities of all axle ends."""
    ends = model.mass.size
    u = y[(4 * ends) + ends + U]
    arc = model.seg_start[12] - model.seg_start[11]
    for e in range(ends):
        s, n = y[e], y[ends + e]
        k = marks[SEGMENT, e]
        shift = 0.0
        if marks[CARRIED, e] == 0:
            while k < 10 and s > model.seg_start[k + 1]:
                k += 1
            while k > 0 and s < model.seg_start[k]:
                k -= 1
            marks[SEGMENT, e] = k
        else:
            k = 11
            shift = u
        along = s - model.seg_start[k]
        kappa, heading = model.seg_curvature[k], model.seg_heading[k]
        x, z = model.seg_x[k], model.seg_z[k]
        design = model.seg_design[k] + along * model.seg_scale[k]
        if k == 11 and along < 0.0:  # beyond either end the carriage's rail is straight, level
            kappa = 0.0
        elif k == 11 and along > arc:
            kappa, along = 0.0, along - arc
            x, z = model.seg_x[0], model.seg_z[0]
        if kappa == 0.0:
            c, d = model.seg_cos[k], model.seg_sin[k]
            if k == 11 and along > 0.0:
                c, d = 1.0, 0.0
            x += along * c
            z += along * d
        else:
            d0, c0 = model.seg_sin[k], model.seg_cos[k]
            heading += kappa * along
            c, d = math.cos(heading), math.sin(heading)
            x += (d - d0) / kappa
            z -= (c - c0) / kappa
        vt, vn = y[2 * ends + e], y[3 * ends + e]
        work[X, e] = x - n * d - shift
        work[Z, e] = z + n * c
        work[VX, e] = vt * c - vn * d
        work[VZ, e] = vt * d + vn * c
        work[COS, e], work[SIN, e], work[KAPPA, e] = c, d, kappa
        work[S_DESIGN, e] = design


@kernel
def look_up(model, s):
    """Return a path coordinate's cell in the guide's tables, the next one, and the part."""
    cells = model.lateral.size
    place_in = s / model.cell + cells
    if not 0.0 <= place_in < 3 * cells:  # only a machine that has left its guide
        return 0, 1, math.nan
    cell = int(place_in)
    part = place_in - cell
    cell %= cells
    return cell, cell + 1 if cell + 1 < cells else 0, part


@kernel
def saturate(x):
    """Return tanh(x), without computing it where it is 1 in double precision."""
    return math.copysign(1.0, x) if abs(x) > 19.0 else math.tanh(x)


@kernel
def tread_height(model, e, s, laps):
    """Return how far the tread stands out where it meets either track (m)."""
    turned = (s + laps * model.loop) / model.radius
    height = 0.0
    if model.ecc[e] != 0.0:
        height += model.ecc[e] * math.cos(turned + model.ecc_phase[e])
    if model.flat[e] != 0.0:
        angle = (turned + model.flat_phase[e]) % (2.0 * math.pi) - math.pi
        if abs(angle) < 0.5 * model.flat_angle:
            height -= (
                model.flat[e] * 0.5 * (1.0 + math.cos(2.0 * math.pi * angle / model.flat_angle))
            )
    return height


@kernel
def guide_forces(model, y, dy, marks, work, t):
    """Contact, rolling drag and gravity on every axle end; return the pull on the carriage."""
    ends = model.mass.size
    tail = 5 * ends
    w = y[tail + U_RATE]
    mode, mode_rate = y[tail + MODE], y[tail + MODE_RATE]
    half = ends // 2
    pull_x = 0.0
    frame_pull = 0.0
    rub = 0.0
    if model.rub_force > 0.0 and (t % model.rub_period) < model.rub_on:
        rub = model.rub_force
    warmth = 1.0 + model.resistance_rate * t
    for e in range(ends):
        side = 0 if e < half else 1
        c, d, kappa = work[COS, e], work[SIN, e], work[KAPPA, e]
        s, n = y[e], y[ends + e]
        vt, vn = y[2 * ends + e], y[3 * ends + e]
        if marks[CARRIED, e] == 1:
            vt += w * c
            vn -= w * d
        if model.mode_mass > 0.0:
            lift = -model.mode_x * d + model.mode_z * c
            n -= mode * lift
            vn -= mode_rate * lift
        s_rate = vt / (1.0 - kappa * n)
        work[S_RATE, e] = s_rate
        dy[e] = s_rate
        dy[ends + e] = vn + (mode_rate * (-model.mode_x * d + model.mode_z * c))
        cell, after, part = look_up(model, work[S_DESIGN, e])
        line = model.normal[side, cell] * (1.0 - part) + model.normal[side, after] * part
        slope = model.normal_slope[side, cell] * (1.0 - part)
        slope += model.normal_slope[side, after] * part
        gap = n - line
        gap_rate = vn - slope * s_rate * model.reading[1]
        half_play = model.half_play[side, cell]
        if model.ecc[e] != 0.0 or model.flat[e] != 0.0:
            height = tread_height(model, e, s, marks[LAPS, e])
            half_play -= height * model.reading[2]
            gap -= height * (1.0 - model.reading[2])
        stiffness = model.support[side, cell] * model.contact_k
        # a high tread may touch both tracks at once: each only pushes, and each resists rolling
        lower = upper = 0.0
        if gap < -half_play:
            lower = max(stiffness * (-half_play - gap) - model.contact_c * gap_rate, 0.0)
        if gap > half_play:
            upper = max(stiffness * (gap - half_play) + model.contact_c * gap_rate, 0.0)
        normal = lower - upper
        work[NORMAL, e] = normal
        pressing = abs(normal) if model.reading[3] > 0.5 else lower + upper
        dry = model.resistance[e] * warmth * pressing + model.extra_drag[e]
        dry += model.stretch_drag[side, cell] + model.seizing[e] * max(t, 0.0)
        if rub > 0.0 and model.rub_from < work[S_DESIGN, e] < model.rub_to:
            dry += rub
        drag = dry * saturate(vt / model.roll_speed) + model.viscous * vt
        if marks[CARRIED, e] == 1:
            pull_x += normal * d + drag * c * model.reading[0]
        if model.mode_mass > 0.0:
            frame_pull -= normal * (-model.mode_x * d + model.mode_z * c)
            frame_pull += drag * (model.mode_x * c + model.mode_z * d)
        weight = model.mass[e] * model.gravity
        work[FT, e] = -drag - weight * d
        if model.mode_mass > 0.0:
            # the gap of a frame that stands lower changes along an arc: what its contact stores
            # also pushes along the path
            work[FT, e] += normal * mode * kappa * (model.mode_x * c + model.mode_z * d)
        work[FN, e] = normal - weight * c
        work[FX, e] = 0.0
        work[FZ, e] = 0.0
    return pull_x, frame_pull


@kernel
def link_forces(model, work, t):
    """Tension of every link and the racking between an axle's two ends."""
    ends = model.mass.size
    half = ends // 2
    warmth = 1.0 + model.rest_rate * t
    for e in range(ends):
        f = e + 1
        if f == half:
            f = 0
        elif f == ends:
            f = half
        dx, dz = work[X, f] - work[X, e], work[Z, f] - work[Z, e]
        length = math.sqrt(dx * dx + dz * dz)
        dx /= length
        dz /= length
        rate = (work[VX, f] - work[VX, e]) * dx + (work[VZ, f] - work[VZ, e]) * dz
        force = model.link_k[e] * (length - model.rest[e] * warmth) + model.link_c[e] * rate
        work[TENSION, e] = force
        work[FX, e] += force * dx
        work[FZ, e] += force * dz
        work[FX, f] -= force * dx
        work[FZ, f] -= force * dz
    for e in range(half):
        f = e + half
        dx = work[X, f] - work[X, e] - model.bend[e] * work[COS, e]
        dz = work[Z, f] - work[Z, e] - model.bend[e] * work[SIN, e]
        fx = model.rack_k * dx + model.rack_c * (work[VX, f] - work[VX, e])
        fz = model.rack_k * dz + model.rack_c * (work[VZ, f] - work[VZ, e])
        work[FX, e] += fx
        work[FZ, e] += fz
        work[FX, f] -= fx
        work[FZ, f] -= fz


@kernel
def rates(model, t, y, marks, slip, work, dy):
    """Time derivative of the whole state."""
    ends = model.mass.size
    half = ends // 2
    tail = 5 * ends
    place(model, y, marks, work)
    pull_x, frame_pull = guide_forces(model, y, dy, marks, work, t)
    link_forces(model, work, t)
    load_forces(model, work, t)
    speed = rack_speed(model, t, y[tail + RACK])
    frame_pull += drive_forces(model, y, marks, slip, work, speed)
    for e in range(ends):
        c, d = work[COS, e], work[SIN, e]
        ft = work[FT, e] + work[FX, e] * c + work[FZ, e] * d
        fn = work[FN, e] - work[FX, e] * d + work[FZ, e] * c
        turn = work[KAPPA, e] * work[S_RATE, e]
        at, an = ft / model.mass[e], fn / model.mass[e]
        work[FT, e], work[FN, e] = at, an
        dy[2 * ends + e] = at + turn * y[3 * ends + e]
        dy[3 * ends + e] = an - turn * y[2 * ends + e]
    for i in range(half):
        # by the rollers' own way, as the recordings of other makers have it (docs/causes.md)
        cell, after, part = look_up(model, y[i])
        line = model.lateral[cell] + part * (model.lateral[after] - model.lateral[cell])
        slope = model.lateral_slope[cell]
        slope += part * (model.lateral_slope[after] - slope)
        off = y[4 * ends + i] - line
        rate = y[4 * ends + half + i]
        off_rate = rate - slope * work[S_RATE, i]
        dy[4 * ends + i] = rate
        dy[4 * ends + half + i] = -(model.lat_k * off + model.lat_c * off_rate) / model.lat_mass[i]
    carriage_rates(model, t, y, dy, pull_x)
    dy[tail + RACK] = speed
    dy[tail + MODE] = y[tail + MODE_RATE]
    if model.mode_mass > 0.0:
        force = frame_pull + model.mode_carried
        force -= model.mode_k * y[tail + MODE] + model.mode_c * y[tail + MODE_RATE]
        dy[tail + MODE_RATE] = force / model.mode_mass
    else:
        dy[tail + MODE_RATE] = 0.0
