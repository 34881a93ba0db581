"""What the force law remembers from step to step beside MuJoCo's coordinates."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from escalator_twin.signals import Floats

NO_DOG = -(2**40)  # an axle end outside the drive zone
TRAVEL, TIME, ROLLING = range(3)  # entries of ``rack``


class State(NamedTuple):
    """Memory and results of the law; m sides, n axles, nv coordinates, c moving guide parts.

    Axles come last: what is done to each end alike is done to several at once.

    The moving parts of the guide are the carriage and, where the frame is not rigid, the frame.
    """

    rack: Floats  # (3,): travel of the rack m, time s, rolling speed while relaxing m/s
    segment: NDArray[np.int64]  # (m, n) of the guide
    dog: NDArray[np.int64]  # (m, n) of the drive
    roll: Floats  # (m, n) rolled way, m
    s: Floats  # (m, n) path coordinate
    speed: Floats  # (m, n) along the path
    normal: Floats  # (m, n) contact force, N, positive on the lower track
    tension: Floats  # (m, n)
    acceleration: Floats  # (nv,) of the last step
    velocity: Floats  # (nv,) at the step itself, extrapolated
    place: Floats  # (2, m, n): x, z of the axle ends
    rate: Floats  # (2, m, n): their velocity at the step itself
    middle: Floats  # (2, m, n): their velocity half a step before
    contact: Floats  # (11, m, n), see the rows in ``contact``
    direction: Floats  # (2, m, n) of the links
    force: Floats  # (2, m, n) on the axle ends, N
    inverse: Floats  # (3, m, n): xx, xz, zz of an end's effective inverse mass
    reaction: Floats  # (c,) on the moving parts, N
    coupling: Floats  # (c, 2, m, n) force on an end per acceleration of a moving part, kg
    inertia: Floats  # (c, c) of the moving parts, with what contacts add, kg
    free: Floats  # (1 + c, 2, m, n) accelerations of the ends: of the forces, of each coupling
    work: Floats  # (7, m, n) of the links' system, see the rows in ``chain``


def make_state(n_sides: int, n_axles: int, n_coordinates: int, n_moving: int) -> State:
    """Return an empty state for ``n_axles`` axles and ``n_moving`` moving parts of the guide."""
    shape = (n_sides, n_axles)
    return State(
        rack=np.zeros(3),
        segment=np.zeros(shape, np.int64),
        dog=np.full(shape, NO_DOG, np.int64),
        roll=np.zeros(shape),
        s=np.zeros(shape),
        speed=np.zeros(shape),
        normal=np.zeros(shape),
        tension=np.zeros(shape),
        acceleration=np.zeros(n_coordinates),
        velocity=np.zeros(n_coordinates),
        place=np.zeros((2, *shape)),
        rate=np.zeros((2, *shape)),
        middle=np.zeros((2, *shape)),
        contact=np.zeros((11, *shape)),
        direction=np.zeros((2, *shape)),
        force=np.zeros((2, *shape)),
        inverse=np.zeros((3, *shape)),
        reaction=np.zeros(n_moving),
        coupling=np.zeros((n_moving, 2, *shape)),
        inertia=np.zeros((n_moving, n_moving)),
        free=np.zeros((1 + n_moving, 2, *shape)),
        work=np.zeros((7, *shape)),
    )
