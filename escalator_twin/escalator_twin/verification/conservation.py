"""What must be kept: energy without losses, the links' lengths, and rest where nothing drives.

Energy is added up here from positions and velocities, by other formulas than the force law's:
kinetic, gravity, links, contacts beyond the clearance, racking, lateral springs, the carriage on
its spring against its preload.
"""

from dataclasses import replace

import numpy as np

from escalator_twin.machine import Machine
from escalator_twin.physics.parameters import make_parameters, Parameters
from escalator_twin.physics.path import build_path, CARRIAGE, find_segment, point_at, START
from escalator_twin.physics.rails import rail_at
from escalator_twin.physics.rollout import Simulation
from escalator_twin.signals import Floats
from escalator_twin.verification.figure import Figure
from escalator_twin.verification.trial import case, ideal, start, STEP_S

COAST_S = 10.0
REST_S = 2.0
SAMPLE_S = 0.05
MOST_DRIFT = 0.1  # % of the kinetic energy


def without_losses(p: Parameters) -> Parameters:
    """Return parameters without drive, drag, dampers and friction."""
    return p._replace(
        link_damping=p.link_damping * 0.0,
        contact_damping=0.0,
        racking_damping=0.0,
        lateral_damping=0.0,
        carriage_damping=0.0,
        carriage_friction=0.0,
        rolling_resistance=p.rolling_resistance * 0.0,
        viscous_drag=0.0,
        drive_stiffness=0.0,
        drive_damping=0.0,
    )


def energies(simulation: Simulation, velocity: Floats) -> tuple[float, float]:
    """Return kinetic and potential energy (J) at the present coordinates."""
    p, q, mass = simulation.parameters, simulation.data.qpos, simulation.host.mass
    kinetic = 0.5 * float(np.sum(mass * velocity**2))
    m, n = p.end_mass.shape
    ends = q[1:].reshape(n, 1 + 2 * m)
    places = ends[:, 1:].reshape(n, m, 2).transpose(1, 0, 2)
    potential = float(np.sum(p.end_mass * p.gravity * places[:, :, 1]))
    length = np.linalg.norm(np.roll(places, -1, axis=1) - places, axis=2)
    potential += 0.5 * float(np.sum(p.link_stiffness * (length - p.link_length) ** 2))
    if m == 2:
        apart = places[0] - places[1]
        potential += 0.5 * p.racking_stiffness * float(np.sum(apart**2))
    per_m = p.survey.shape[1] / p.length_m
    for side in range(m):
        for i in range(n):
            k, local, offset, _, _ = _project(p, simulation, side, i)
            s = p.segments[k, START] + local
            value, _ = rail_at(simulation.rails.normal, side, s * per_m, per_m)
            beyond = max(abs(offset - value) - p.half_clearance, 0.0)
            potential += 0.5 * p.contact_stiffness * beyond**2
            if side == 0:
                line, _ = rail_at(simulation.rails.lateral, 0, s * per_m, per_m)
                potential += 0.5 * p.lateral_stiffness * (ends[i, 0] - line) ** 2
    potential += 0.5 * p.carriage_stiffness * q[0] ** 2 - p.preload * q[0]
    return kinetic, potential


def _project(
    p: Parameters, simulation: Simulation, side: int, i: int
) -> tuple[int, float, float, float, float]:
    q, stride = simulation.data.qpos, 1 + 2 * p.n_sides
    j = 1 + i * stride + 1 + 2 * side
    hint = int(simulation.state.segment[side, i])
    found: tuple[int, float, float, float, float] = find_segment(
        p.segments, hint, q[j], q[j + 1], q[0], 0.0
    )
    return found


def energy_course(machine: Machine, planar: bool, step_s: float) -> tuple[Floats, Floats]:
    """Return kinetic and total energy (J) of the chain coasting at 0.5 m/s, over time.

    MuJoCo's velocity stands in the middle of a step; the one at the step is the mean of two.
    """
    simulation = start(machine, case(0.5), 5.0, planar=planar, step_s=step_s).simulation
    simulation.parameters = without_losses(simulation.parameters)
    nothing = np.zeros((0, 3), np.int64)
    kinetic, total = [], []
    for _ in range(round(COAST_S / SAMPLE_S)):
        simulation.advance(SAMPLE_S - step_s, 1.0 / step_s, nothing)
        before, place = simulation.data.qvel.copy(), simulation.data.qpos.copy()
        simulation.advance(step_s, 1.0 / step_s, nothing)
        after, following = 0.5 * (before + simulation.data.qvel), simulation.data.qpos.copy()
        simulation.data.qpos[:] = place
        moving, stored = energies(simulation, after)
        simulation.data.qpos[:] = following
        kinetic.append(moving)
        total.append(moving + stored)
    return np.array(kinetic), np.array(total)


def cleared(machine: Machine) -> Machine:
    """Return a machine with its clearance on an exact guide.

    The contact force acts along the design path's normal, so that a surveyed line's slope does
    work which no potential stores.
    """
    return replace(machine, guide=replace(machine.guide, survey_file=None), deviations=())


def energy_drift(machine: Machine, planar: bool = False, step_s: float = 1e-3) -> float:
    """Return the drift of the total energy over ten seconds, by a line, over the kinetic."""
    kinetic, total = energy_course(machine, planar, step_s)
    slope = np.polyfit(np.linspace(0.0, 1.0, len(total)), total, 1)[0]
    return float(abs(slope) / kinetic.mean())


def at_rest(machine: Machine, load_kg: float = 0.0) -> Simulation:
    """Return a machine at rest, its rack standing, its rollers without resistance."""
    experiment = case(0.5, load_kg=load_kg)
    p = make_parameters(machine, experiment)
    p = p._replace(rolling_resistance=p.rolling_resistance * 0.0, viscous_drag=0.0)
    simulation = Simulation(machine, p, build_path(machine.guide), STEP_S)
    simulation.start(5.0, settle_s=0.0)
    simulation.parameters = p._replace(speed=0.0)
    simulation.data.qvel[:] = 0.0
    return simulation


def length_miss(simulation: Simulation) -> float:
    """Return by how much the sum of the links' lengths differs from free length and stretch, m.

    The stretch is force over stiffness; at rest, for either side.
    """
    p, q = simulation.parameters, simulation.data.qpos
    m, n = p.end_mass.shape
    places = q[1:].reshape(n, 1 + 2 * m)[:, 1:].reshape(n, m, 2)
    length = np.linalg.norm(np.roll(places, -1, axis=0) - places, axis=2).sum(axis=0)
    stretched = (p.link_length + simulation.state.tension / p.link_stiffness).sum(axis=1)
    return float(np.abs(length - stretched).max())


def largest_speed(simulation: Simulation, duration_s: float) -> float:
    """Return the largest speed (m/s) of anything while a simulation runs."""
    worst = 0.0
    for _ in range(round(duration_s / SAMPLE_S)):
        simulation.advance(SAMPLE_S, 1.0 / SAMPLE_S, np.zeros((0, 3), np.int64))
        worst = max(worst, float(np.abs(simulation.data.qvel).max()))
    return worst


def _carriage_unbalance(simulation: Simulation) -> float:
    """Return preload and spring against what the rollers press on the carriage, N."""
    p, state, u = simulation.parameters, simulation.state, float(simulation.data.qpos[0])
    pressed = 0.0
    for side, i in np.argwhere(p.segments[state.segment, CARRIAGE] == 1.0):
        _, _, _, tz = point_at(p.segments, p.length_m, state.s[side, i], u)
        pressed -= state.normal[side, i] * tz
    return abs(float(p.preload - p.carriage_stiffness * u + pressed))


def figures(machine: Machine) -> list[Figure]:
    """Return the figures of this page."""
    subject = 'conservation'
    name, loose = 'energy drift over 10 s of the kinetic', cleared(machine)
    found = [
        Figure(subject, f'{name}, {of}', 100 * drift, '%', most)
        for of, drift, most in (
            ('two sides', energy_drift(ideal(machine)), MOST_DRIFT),
            ('planar', energy_drift(ideal(machine), planar=True), MOST_DRIFT),
            ('with clearance, 0.5 ms', energy_drift(loose, step_s=5e-4), MOST_DRIFT),
            ('with clearance, 1 ms', energy_drift(loose), None),
        )
    ]
    simulation = at_rest(machine, load_kg=75.0)
    speed = largest_speed(simulation, REST_S)
    name = 'links: sum of lengths against free length and stretch'
    return [
        *found,
        Figure(subject, name, 1e9 * length_miss(simulation), 'nm', 1.0),
        Figure(subject, 'standstill, loaded: largest speed within 2 s', 1e6 * speed, 'um/s', 10.0),
        Figure(
            subject,
            'standstill, loaded: unbalance of the carriage',
            _carriage_unbalance(simulation),
            'N',
            0.1,
        ),
    ]
