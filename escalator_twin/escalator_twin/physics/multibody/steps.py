"""The step part as a network: chain rollers, steps, trailing rollers, gears.

Bodies in this order: the chain rollers of all steps, the steps, the trailing rollers. A step
follows its axle: link i joins chain rollers i and i + 1, and i + 1 is ahead.
"""

from dataclasses import dataclass
from math import pi

import numpy as np

from escalator_twin.errors import ExperimentError
from escalator_twin.machine.multibody import MultibodyMachine
from escalator_twin.physics.multibody.guide import chain_track, SIDES, Track, trailing_track
from escalator_twin.physics.multibody.network import Network
from escalator_twin.physics.multibody.segments import place_on
from escalator_twin.signals import Experiment, Floats


@dataclass(frozen=True)
class StepPart:
    """A network of steps with what is needed to place it.

    Attributes
    ----------
    network : Network
    chain, trailing : Track
    n : int
        Steps.
    """

    network: Network
    chain: Track
    trailing: Track
    n: int


def seat_speed(machine: MultibodyMachine, speed_m_s: float) -> float:
    """Return the upper gear's rad/s at which one pitch passes in ``pitch / speed``."""
    return 2.0 * pi * speed_m_s / (machine.drive.seats * machine.chain.pitch_m)


def roller_inertia(machine: MultibodyMachine) -> float:
    """Return a pair of rollers' moment of inertia about their axle, as of solid discs, kg m2."""
    return SIDES * 0.5 * machine.roller.mass_kg * (machine.roller.diameter_m / 2.0) ** 2


def step_part(machine: MultibodyMachine, experiment: Experiment) -> StepPart:
    """Lay out a machine's steps, without deviations, in an experiment.

    Raises
    ------
    ExperimentError
        Where a list of loads has another length than there are steps.
    """
    chain, roller, step = machine.chain, machine.roller, machine.step
    n = chain.n_links
    loads = np.array(experiment.load_per_step_kg)
    if len(loads) not in (1, n):
        raise ExperimentError(f'load: expected 1 or {n} values, found {len(loads)}')
    tracks = chain_track(machine), trailing_track(machine)
    rows = len(tracks[0].rows)
    each, none = np.arange(n), np.full(n, -1)
    trailing_mass = SIDES * roller.mass_kg + roller.trailing_extra_kg
    load = np.zeros(3 * n)
    load[n : 2 * n] = np.broadcast_to(loads * machine.gravity_m_s2, (n,))
    drag = [
        roller.rolling_resistance, roller.friction_rise, roller.friction_speed_m_s,
        SIDES * roller.seal_drag_n, SIDES * roller.viscous_drag_n_s_m, roller.creep_speed_m_s,
        roller.diameter_m / 2.0, 0.0,
    ]  # fmt: skip
    bush = [SIDES * step.bush_stiffness_n_m, SIDES * step.bush_damping_n_s_m]
    at_axle = [step.centre_behind_m, step.centre_below_m, *bush]
    at_trailing = [step.centre_behind_m - step.wheelbase_m, step.centre_below_m, *bush]
    link = [SIDES * chain.link_stiffness_n_m, SIDES * chain.link_damping_n_s_m, chain.pitch_m]
    tensioner = machine.tensioner
    network = Network(
        mass=np.repeat([chain.mass_per_pitch_kg, step.mass_kg, trailing_mass], n),
        inertia=np.repeat([roller_inertia(machine), step.inertia_kg_m2, roller_inertia(machine)], n),
        link_ends=np.stack([each, (each + 1) % n], axis=1),
        link=np.tile([*link, 0.0, 0.0, 1.0], (n, 1)),
        bush_ends=np.concatenate([
            np.stack([each, each + n], axis=1), np.stack([each + 2 * n, each + n], axis=1)
        ]),
        bush=np.concatenate([np.tile(at_axle, (n, 1)), np.tile(at_trailing, (n, 1))]),
        point_body=np.concatenate([each, each + 2 * n]),
        point_offset=np.zeros(2 * n),
        point_rows=np.repeat([[0, rows], [rows, 2 * rows]], n, axis=0),
        point_partner=np.tile(each + n, 2),
        drag=np.tile(drag, (2 * n, 1)),
        segments=np.concatenate([track.rows for track in tracks]),
        part=np.array([[
            tensioner.mass_kg, tensioner.stiffness_n_m, tensioner.damping_n_s_m,
            float(experiment.preload_n), tensioner.dry_friction_n, -1.0, 0.0, np.inf, 0.0, 0.0,
        ]]),
        rotor=np.array([[
            experiment.direction * seat_speed(machine, experiment.set_speed_m_s),
            machine.guide.turnaround_radius_m, machine.drive.ramp_m, 0.0, 0.0,
        ]]),
        load=load,
        load_point=np.concatenate([none, each, none]),
        load_stretch=np.array([machine.load.from_m, machine.load.to_m, machine.load.ramp_m]),
        stretch_drag=np.zeros((0, 5)),
        gravity=machine.gravity_m_s2,
    )  # fmt: skip
    return StepPart(network, *tracks, n)


def place_steps(part: StepPart, machine: MultibodyMachine, places_m: Floats) -> Floats:
    """Return the bodies' coordinates with the chain rollers at path coordinates ``places_m``."""
    n, track = part.n, part.chain
    q = np.zeros((3 * n, 3))
    wheelbase = machine.step.wheelbase_m
    for i, s in enumerate(places_m):
        x, z, _, _ = place_on(track.rows, track.length_m, float(s))
        bx, bz = trailing_place(part, float(s), x, z, wheelbase)
        angle = np.arctan2(z - bz, x - bx)
        c, d = np.cos(angle), np.sin(angle)
        behind, below = machine.step.centre_behind_m, machine.step.centre_below_m
        # the axle is at (behind, below) in the frame of the step's centre of mass
        q[i] = x, z, 0.0
        q[n + i] = x - behind * c + below * d, z - behind * d - below * c, angle
        q[2 * n + i] = bx, bz, 0.0
    return q


def trailing_place(
    part: StepPart, s: float, x: float, z: float, wheelbase_m: float
) -> tuple[float, float]:
    """Return where on its track the trailing roller is that is a wheelbase behind an axle."""
    track = part.trailing
    # both tracks are equally long: a first guess is a wheelbase back
    back = (s - wheelbase_m) % track.length_m
    for _ in range(60):
        px, pz, tx, tz = place_on(track.rows, track.length_m, back)
        dx, dz = x - px, z - pz
        distance = np.hypot(dx, dz)
        change = (distance - wheelbase_m) * distance / (dx * tx + dz * tz)
        back = (back + change) % track.length_m
        if abs(change) < 1e-12:
            break
    return float(px), float(pz)
