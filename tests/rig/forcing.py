"""What drives, loads and tensions the chain: rack, loads and carriage, compiled."""

import math

from rig.kernel import kernel
from rig.layout import (
    COS,
    DOG,
    FT,
    FZ,
    MODE,
    MODE_RATE,
    NO_DOG,
    PULL,
    RACK,
    S_DESIGN,
    S_RATE,
    SIN,
    U,
    U_RATE,
)


@kernel
def ramp(s, start, end, width):
    """Return 0 outside start..end, 1 inside, rising and falling linearly within it."""
    if s <= start or s >= end:
        return 0.0
    return min(1.0, min(s - start, end - s) / width)


@kernel
def load_forces(model, work, t):
    """Weight of each step's load, half on each of its two axles."""
    ends = model.mass.size
    half = ends // 2
    swing = 1.0 + model.swing * math.sin(2.0 * math.pi * model.swing_hz * t)
    if t > model.boarding_s:
        swing += model.boarding
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
        share = ramp(
            work[S_DESIGN, e] + 0.5 * ahead, model.load_from, model.load_to, model.load_ramp
        )
        weight = 0.5 * model.load[e] * model.gravity * share * swing
        work[FZ, e] -= weight
        work[FZ, f] -= weight


@kernel
def rack_speed(model, t, travel):
    """Return the rack's speed along +s (m/s): mean, slow wander, ripple, hunting."""
    place_in = min(max(t / model.wander_step, 0.0), model.wander.size - 1.000001)
    k = int(place_in)
    relative = model.wander[k] + (place_in - k) * (model.wander[k + 1] - model.wander[k])
    relative += model.hunting * math.sin(
        2.0 * math.pi * model.hunting_hz * t + model.hunting_phase
    )
    # a ripple over travel spends longer where it is slow: the root keeps the mean speed
    ripple = 1.0 + model.ripple * math.sin(
        2.0 * math.pi * model.ripple_per_m * travel + model.ripple_phase
    )
    ripple /= math.sqrt(1.0 - model.ripple**2)
    return model.direction * model.speed * (1.0 + relative) * ripple


@kernel
def dog_offset(model, dog):
    """Return how far a dog sits from its place on the rack (m)."""
    if model.bad_dog_m != 0.0 and dog % model.rack_dogs == model.bad_dog:
        return model.bad_dog_m
    return 0.0


@kernel
def drive_forces(model, y, marks, slip, work, speed):
    """Pull of the rack's dogs on the axle ends in the drive; return its share on the frame."""
    ends = model.mass.size
    rack = y[5 * ends + RACK]
    frame_pull = 0.0
    for e in range(ends):
        s = work[S_DESIGN, e]
        share = ramp(s, model.drive_from, model.drive_to, model.drive_ramp)
        work[PULL, e] = 0.0
        if share == 0.0:
            continue
        dog = marks[DOG, e]
        if dog == NO_DOG:
            dog = round((s - rack) / model.pitch)
        target = rack + dog * model.pitch + slip[e] + dog_offset(model, dog)
        target_rate = speed
        if model.mode_mass > 0.0:
            along = model.mode_x * work[COS, e] + model.mode_z * work[SIN, e]
            target += along * y[5 * ends + MODE]
            target_rate += along * y[5 * ends + MODE_RATE]
        pull = model.drive_k * (target - s) + model.drive_c * (target_rate - work[S_RATE, e])
        if abs(pull) > model.slip_force:
            pull = math.copysign(model.slip_force, pull)
        work[PULL, e] = pull
        work[FT, e] += share * pull
        if model.mode_mass > 0.0:
            frame_pull -= share * pull * along
    return frame_pull


@kernel
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
    if model.shake_force != 0.0:
        force += model.shake_force * math.sin(2.0 * math.pi * model.shake_hz * t)
    dy[tail + U] = w
    dy[tail + U_RATE] = (force - pull_x) / model.carriage_mass
