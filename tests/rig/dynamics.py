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

from numba import njit

# rows of the work array
X, Z, VX, VZ, COS, SIN, KAPPA, S_RATE, FT, FN, NORMAL, S_DESIGN, FX, FZ, TENSION = range(15)
WORK_ROWS = 15
# rows of the integer array: segment, on the carriage, dog (index), inside the drive, laps
SEGMENT, CARRIED, DOG, ENGAGED, LAPS = range(5)
MARK_ROWS = 5
# behind the lateral states
U, U_RATE, RACK, MODE, MODE_RATE = range(5)
TAIL = 5
NO_DOG = -(2**40)


@njit(cache=True)
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


@njit(cache=True)
def saturate(x):
    """Return tanh(x), without computing it where it is 1 in double precision."""
    return math.copysign(1.0, x) if abs(x) > 19.0 else math.tanh(x)


@njit(cache=True)
def roller_offset(model, e, s, laps):
    """Return how far the tread's radius pushes the roller's centre off its track (m)."""
    turned = (s + laps * model.loop) / model.radius
    offset = 0.0
    if model.ecc[e] != 0.0:
        offset += model.ecc[e] * math.cos(turned + model.ecc_phase[e])
    if model.flat[e] != 0.0:
        angle = (turned + model.flat_phase[e]) % (2.0 * math.pi) - math.pi
        if abs(angle) < 0.5 * model.flat_angle:
            offset -= model.flat[e] * 0.5 * (
                1.0 + math.cos(2.0 * math.pi * angle / model.flat_angle))
    return offset


@njit(cache=True)
def guide_forces(model, y, dy, marks, work, t):
    """Contact, rolling drag and gravity on every axle end; return the pull on the carriage."""
    ends = model.mass.size
    tail = 5 * ends
    w = y[tail + U_RATE]
    mode, mode_rate = y[tail + MODE], y[tail + MODE_RATE]
    cells = model.normal.shape[1]
    half = ends // 2
    pull_x = 0.0
    frame_pull = 0.0
    rub = 0.0
    if model.rub_force > 0.0 and (t % model.rub_period) < model.rub_on:
        rub = model.rub_force
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
        place_in = work[S_DESIGN, e] / model.cell + cells
        cell = int(place_in)
        part = place_in - cell
        if cell >= cells:
            cell -= cells
        after = cell + 1 if cell + 1 < cells else 0
        line = model.normal[side, cell] * (1.0 - part) + model.normal[side, after] * part
        slope = model.normal_slope[side, cell] * (1.0 - part)
        slope += model.normal_slope[side, after] * part
        if model.ecc[e] != 0.0 or model.flat[e] != 0.0:
            line += roller_offset(model, e, s, marks[LAPS, e])
        gap = n - line
        gap_rate = vn - slope * s_rate * model.option[1]
        support = model.support[side, cell]
        normal = 0.0
        if gap < -model.half_play[side, cell]:
            depth = -model.half_play[side, cell] - gap
            normal = support * model.contact_k * depth - model.contact_c * gap_rate
            normal = max(normal, 0.0)
        elif gap > model.half_play[side, cell]:
            depth = gap - model.half_play[side, cell]
            normal = support * model.contact_k * depth + model.contact_c * gap_rate
            normal = -max(normal, 0.0)
        work[NORMAL, e] = normal
        dry = model.resistance[e] * abs(normal) + model.extra_drag[e]
        dry += model.stretch_drag[side, cell]
        if rub > 0.0 and model.rub_from < work[S_DESIGN, e] < model.rub_to:
            dry += rub
        drag = dry * saturate(vt / model.roll_speed) + model.viscous * vt
        if marks[CARRIED, e] == 1:
            pull_x += -normal * -d + model.option[2] * drag * c
        if model.mode_mass > 0.0:
            frame_pull -= normal * (-model.mode_x * d + model.mode_z * c)
            frame_pull += drag * (model.mode_x * c + model.mode_z * d)
        weight = model.mass[e] * model.gravity
        work[FT, e] = -drag - weight * d
        work[FN, e] = normal - weight * c
        work[FX, e] = 0.0
        work[FZ, e] = 0.0
    return pull_x, frame_pull


@njit(cache=True)
def link_forces(model, y, work):
    """Tension of every link and the racking between an axle's two ends."""
    ends = model.mass.size
    half = ends // 2
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
        force = model.link_k[e] * (length - model.rest[e]) + model.link_c[e] * rate
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


@njit(cache=True)
def ramp(s, start, end, width):
    """Return 0 outside start..end, 1 inside, rising and falling linearly within it."""
    if s <= start or s >= end:
        return 0.0
    return min(1.0, min(s - start, end - s) / width)


@njit(cache=True)
def load_forces(model, work, t):
    """Weight of each step's load, half on each of its two axles."""
    ends = model.mass.size
    half = ends // 2
    swing = 1.0 + model.swing * math.sin(2.0 * math.pi * model.swing_hz * t)
    for e in range(ends):
        if model.load[e] == 0.0:
            continue
        f = e + 1
        if f == half:
            f = 0
        elif f == ends:
            f = half
        ahead = work[S_DESIGN, f] - work[S_DESIGN, e]
        if abs(ahead) > 1.0:  # the seam lies between them
            continue
        share = ramp(work[S_DESIGN, e] + 0.5 * ahead, model.load_from, model.load_to,
                     model.load_ramp)
        weight = 0.5 * model.load[e] * model.gravity * share * swing
        work[FZ, e] -= weight
        work[FZ, f] -= weight


@njit(cache=True)
def rack_speed(model, t, travel):
    """Return the rack's speed along +s (m/s): mean, slow wander, ripple, hunting."""
    relative = 0.0
    for k in range(model.wander.shape[0]):
        relative += model.wander[k, 0] * math.sin(
            2.0 * math.pi * model.wander[k, 1] * t + model.wander[k, 2])
    relative += model.ripple * math.sin(
        2.0 * math.pi * model.ripple_per_m * travel + model.ripple_phase)
    relative += model.hunting * math.sin(
        2.0 * math.pi * model.hunting_hz * t + model.hunting_phase)
    return model.direction * model.speed * (1.0 + relative)


@njit(cache=True)
def dog_offset(model, dog):
    """Return how far a dog sits from its place on the rack (m)."""
    if model.bad_dog_m != 0.0 and dog % model.rack_dogs == model.bad_dog:
        return model.bad_dog_m
    return 0.0


@njit(cache=True)
def drive_forces(model, y, marks, slip, work, speed):
    """Pull of the rack's dogs on the axle ends in the drive; return its share on the frame."""
    ends = model.mass.size
    rack = y[5 * ends + RACK]
    for e in range(ends):
        s = work[S_DESIGN, e]
        share = ramp(s, model.drive_from, model.drive_to, model.drive_ramp)
        if share == 0.0:
            continue
        dog = marks[DOG, e]
        if dog == NO_DOG:
            dog = int(round((s - rack) / model.pitch))
        target = rack + dog * model.pitch + slip[e] + dog_offset(model, dog)
        pull = model.drive_k * (target - s) + model.drive_c * (speed - work[S_RATE, e])
        if abs(pull) > model.slip_force:
            pull = math.copysign(model.slip_force, pull)
        work[FT, e] += share * pull


@njit(cache=True)
def rates(model, t, y, marks, slip, work, dy):
    """Time derivative of the whole state."""
    ends = model.mass.size
    half = ends // 2
    tail = 5 * ends
    place(model, y, marks, work)
    pull_x, frame_pull = guide_forces(model, y, dy, marks, work, t)
    link_forces(model, y, work)
    load_forces(model, work, t)
    speed = rack_speed(model, t, y[tail + RACK])
    drive_forces(model, y, marks, slip, work, speed)
    for e in range(ends):
        c, d = work[COS, e], work[SIN, e]
        ft = work[FT, e] + work[FX, e] * c + work[FZ, e] * d
        fn = work[FN, e] - work[FX, e] * d + work[FZ, e] * c
        turn = work[KAPPA, e] * work[S_RATE, e]
        at, an = ft / model.mass[e], fn / model.mass[e]
        work[FT, e], work[FN, e] = at, an
        dy[2 * ends + e] = at + turn * y[3 * ends + e]
        dy[3 * ends + e] = an - turn * y[2 * ends + e]
    cells = model.lateral.size
    for i in range(half):
        place_in = work[S_DESIGN, i] / model.cell
        cell = int(place_in + cells) % cells
        off = y[4 * ends + i] - model.lateral[cell]
        rate = y[4 * ends + half + i]
        off_rate = rate - model.lateral_slope[cell] * work[S_RATE, i] * model.option[3]
        dy[4 * ends + i] = rate
        dy[4 * ends + half + i] = -(model.lat_k * off + model.lat_c * off_rate) / model.lat_mass
    carriage_rates(model, t, y, dy, pull_x)
    dy[tail + RACK] = speed
    dy[tail + MODE] = y[tail + MODE_RATE]
    if model.mode_mass > 0.0:
        force = frame_pull - model.mode_k * y[tail + MODE] - model.mode_c * y[tail + MODE_RATE]
        dy[tail + MODE_RATE] = force / model.mode_mass
    else:
        dy[tail + MODE_RATE] = 0.0


@njit(cache=True)
def carriage_rates(model, t, y, dy, pull_x):
    """Carriage: spring, damper, dry friction, stop, blows, and what the chain pulls."""
    tail = 5 * model.mass.size
    u, w = y[tail + U], y[tail + U_RATE]
    force = model.preload * (1.0 + model.preload_rate * t) - model.tens_k * u
    force -= model.tens_k3 * u * u * u + model.tens_c * w
    force -= model.dry * math.tanh(w / model.dry_speed)
    if u > model.stop:
        force -= max(model.stop_k * (u - model.stop) + model.stop_c * w, 0.0)
    if model.blow_force != 0.0:
        since = t % model.blow_period
        if since < model.blow_width:
            force += model.blow_force * math.sin(math.pi * since / model.blow_width)
    dy[tail + U] = w
    dy[tail + U_RATE] = (force - pull_x) / model.carriage_mass
