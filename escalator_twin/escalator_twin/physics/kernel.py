"""The force law and its linearly implicit step, compiled.

MuJoCo holds the state and integrates with its semi-implicit Euler method, whose velocity then
stands at the middle of the step (leapfrog). For stiff parts the force handed over is that of the
average-acceleration form,

    (M + h/2 D + h^2/4 K) a = f(q_n, w),    w = qvel at n - 1/2,

which is of second order, takes no energy, and leaves the step size to accuracy. K and D hold
links, contacts and drive; what is soft against an axle's inertia stays explicit: racking. Links
couple neighbours by one direction each, so the system reduces to one cyclic tridiagonal one in
the link forces, with the carriage (and a bouncing frame) as a border: its cost is proportional to
the number of links.

Coordinates: q = [carriage, (frame), axle 0: y, (x, z) of each side, axle 1: ...].
"""

from escalator_twin.physics import chain
from escalator_twin.physics.compiled import compiled, inlined
from escalator_twin.physics.contact import end_forces, saturating
from escalator_twin.physics.parameters import Parameters
from escalator_twin.physics.rails import rail_at, Rails
from escalator_twin.physics.state import State
from escalator_twin.signals import Floats

# Dry friction on the carriage saturates as tanh(u' / this): with its force and the tolerances free,
# the labelled recording asks for at most 0.5 mm/s (docs/generator.md).
CARRIAGE_CREEP_M_S = 0.5e-3


@compiled
def lateral_step(
    out: Floats, q: Floats, w: Floats, h: float, s: Floats, speed: Floats, lateral: Floats,
    length_m: float, end_mass: Floats, stiffness: float, damping: float, base: int,
) -> None:  # fmt: skip
    """Write the lateral accelerations: mass against a spring-damper to the guide's line."""
    m, n = s.shape
    stride = 1 + 2 * m
    per_m = lateral.shape[1] / length_m
    added = 0.5 * h * damping + 0.25 * h * h * stiffness
    half_loop = 0.5 * length_m
    for i in range(n):
        j = base + i * stride
        # the mean of both ends; they may lie on two sides of the loop's seam
        apart = s[m - 1, i] - s[0, i]
        if abs(apart) > half_loop:
            apart -= length_m if apart > 0.0 else -length_m
        line, slope = rail_at(lateral, 0, (s[0, i] + 0.5 * apart) * per_m, per_m)
        along = 0.5 * (speed[0, i] + speed[m - 1, i])
        mass = end_mass[0, i] + end_mass[m - 1, i] * (m - 1)
        pull = stiffness * (line - q[j]) + damping * (slope * along - w[j])
        out[j] = pull / (mass + added)


@inlined
def part_step(
    p: Parameters, q: Floats, w: Floats, h: float, reaction: Floats, inertia: Floats, out: Floats
) -> None:
    """Write the accelerations of carriage and frame."""
    push = p.preload - p.carriage_stiffness * q[0] - p.carriage_damping * w[0] + reaction[0]
    mass = inertia[0, 0] + p.carriage_mass
    mass += 0.5 * h * p.carriage_damping + 0.25 * h * h * p.carriage_stiffness
    if p.carriage_friction > 0.0:
        share = saturating(w[0] / CARRIAGE_CREEP_M_S)
        push -= p.carriage_friction * share
        mass += 0.5 * h * p.carriage_friction * (1.0 - share * share) / CARRIAGE_CREEP_M_S
    if q[0] > p.carriage_stop:
        stop = p.stop_stiffness * (q[0] - p.carriage_stop) + p.stop_damping * w[0]
        if stop > 0.0:
            push -= stop
            mass += 0.5 * h * p.stop_damping + 0.25 * h * h * p.stop_stiffness
    lift_push, lift_mass, shared = 0.0, 1.0, 0.0
    if len(reaction) == 2:
        lift_push = reaction[1] - p.frame[1] * q[1] - p.frame[2] * w[1]
        lift_mass = inertia[1, 1] + p.frame[0] + 0.5 * h * p.frame[2] + 0.25 * h * h * p.frame[1]
        shared = inertia[0, 1]
        push -= shared / lift_mass * lift_push
        mass -= shared * shared / lift_mass
    out[0] = push / mass
    if len(reaction) == 2:
        out[1] = (lift_push - shared * out[0]) / lift_mass


@inlined
def accelerations(
    p: Parameters, rails: Rails, state: State, q: Floats, w: Floats, v: Floats, h: float
) -> None:
    """Evaluate the law at ``q`` with mid-step velocity ``w``; fill ``state.acceleration``.

    ``v`` is work space: the velocity at the step itself, extrapolated, for the explicit terms.
    """
    out, force, direction, inverse = (
        state.acceleration,
        state.force,
        state.direction,
        state.inverse,
    )
    free, work, reaction, inertia = state.free, state.work, state.reaction, state.inertia
    for i in range(len(v)):
        v[i] = w[i] + 0.5 * h * out[i]
    end_forces(p, rails, state, q, v, w, h)
    chain.add_loads(force, state.s, p.load, p.length_m, p.load_from, p.load_to, p.load_ramp)
    if p.n_sides == 2:
        chain.add_racking(force, state.place, state.rate, p.racking_stiffness, p.racking_damping)
    chain.link_forces(state, (p.link_stiffness, p.link_damping, p.link_length), h)
    chain.free_accelerations(free, inverse, force, state.coupling)
    chain.fill_system(work, free, inverse, direction, p.link_stiffness, p.link_damping, h)
    chain.solve_cyclic(work)
    chain.link_up(work, direction, inverse, free, force)
    chain.settle_parts(free, state.coupling, reaction, inertia)
    part_step(p, q, w, h, reaction, inertia, out)
    chain.write_accelerations(out, free)
    lateral_step(
        out, q, w, h, state.s, state.speed, rails.lateral, p.length_m, p.end_mass,
        p.lateral_stiffness, p.lateral_damping, len(reaction),
    )  # fmt: skip
    chain.correct_tension(state.tension, direction, p.link_damping, free, h)
