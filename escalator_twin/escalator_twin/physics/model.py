"""The MuJoCo model of a chain: bodies on slides, so that its mass matrix is diagonal."""

from functools import lru_cache
from typing import NamedTuple

import mujoco
import numpy as np

from escalator_twin.physics.parameters import Parameters, SIDES

AXES = {'x': (1.0, 0.0, 0.0), 'y': (0.0, 1.0, 0.0), 'z': (0.0, 0.0, 1.0)}
OFF = (
    'mjDSBL_CONSTRAINT', 'mjDSBL_EQUALITY', 'mjDSBL_FRICTIONLOSS', 'mjDSBL_LIMIT',
    'mjDSBL_CONTACT', 'mjDSBL_SPRING', 'mjDSBL_DAMPER', 'mjDSBL_CLAMPCTRL', 'mjDSBL_ACTUATION',
    'mjDSBL_REFSAFE', 'mjDSBL_EULERDAMP', 'mjDSBL_AUTORESET',
)  # fmt: skip


def _slide(
    body: mujoco.MjsBody, name: str, axis: tuple[float, float, float], added_kg: float = 0.0
) -> None:
    body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis, armature=added_kg)


def _body(parent: mujoco.MjsBody, name: str, mass: float) -> mujoco.MjsBody:
    return parent.add_body(
        name=name, mass=mass, inertia=[mass] * 3, ipos=[0, 0, 0], explicitinertial=True
    )


class Bodies(NamedTuple):
    """What the MuJoCo model of a chain is made of.

    Attributes
    ----------
    sides, axles : int
    end_mass : bytes
        Of float64, kg, (sides, axles).
    carriage_mass, frame_mass, gravity : float
    step_s : float
        Time step, s.
    half_gauge_m, radius_m : float
        Half the track gauge and the rollers' radius, m, for what a viewer shows.
    visual : bool
        Add the rollers as spheres, for a viewer.
    """

    sides: int
    axles: int
    end_mass: bytes
    carriage_mass: float
    frame_mass: float
    gravity: float
    step_s: float
    half_gauge_m: float
    radius_m: float
    visual: bool


def compiled_model(
    p: Parameters, step_s: float, half_gauge_m: float, radius_m: float, visual: bool
) -> mujoco.MjModel:
    """Return the model of a chain in the coordinates of the force law; like ones share it.

    Nobody may write to it. Parameters are those of `Bodies`.
    """
    sides, axles = p.end_mass.shape
    masses = np.ascontiguousarray(p.end_mass, np.float64).tobytes()
    return _compiled(
        Bodies(
            sides, axles, masses, float(p.carriage_mass), float(p.frame[0]), float(p.gravity),
            step_s, half_gauge_m, radius_m, visual,
        )
    )  # fmt: skip


@lru_cache(maxsize=16)  # one machine's tolerances are turned many times with the same masses
def _compiled(bodies: Bodies) -> mujoco.MjModel:
    return build_spec(bodies).compile()


def build_spec(b: Bodies) -> mujoco.MjSpec:
    """Return the ``MjSpec`` of a chain in the coordinates of the force law."""
    end_mass = np.frombuffer(b.end_mass).reshape(b.sides, b.axles)
    spec = mujoco.MjSpec()
    spec.modelname = 'linked_chain'
    option = spec.option
    option.timestep = b.step_s
    option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    option.gravity = (0.0, 0.0, -b.gravity)
    for flag in OFF:
        option.disableflags |= getattr(mujoco.mjtDisableBit, flag)
    spec.memory = 1 << 20
    spec.compiler.autolimits = False
    world = spec.worldbody
    carriage = _body(world, 'carriage', b.carriage_mass)
    _slide(carriage, 'carriage', (-1.0, 0.0, 0.0))
    if b.frame_mass > 0.0:
        _slide(_body(world, 'frame', b.frame_mass), 'frame', AXES['z'])
    names = SIDES if b.sides == 2 else ('both',)
    for i in range(b.axles):
        for side, name in enumerate(names):
            end = _body(world, f'axle_{i}_{name}', float(end_mass[side, i]))
            if side == 0:
                # the axle moves sideways as one: its first end carries the others' inertia
                rest = float(end_mass[1:, i].sum())
                _slide(end, f'axle_{i}_y', AXES['y'], rest)
            for axis in ('x', 'z'):
                _slide(end, f'axle_{i}_{name}_{axis}', AXES[axis])
            if b.visual:
                place = (0.0, b.half_gauge_m * (1 - 2 * side) * (b.sides - 1), 0.0)
                end.add_geom(
                    type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[b.radius_m, 0, 0], pos=place,
                    contype=0, conaffinity=0, mass=0.0,
                )  # fmt: skip
    return spec


def mass_diagonal(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    """Return the diagonal of the mass matrix, having checked that there is nothing else."""
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    diagonal = np.diag(full).copy()
    if np.abs(full - np.diag(diagonal)).max() > 0.0:
        raise AssertionError('the force law needs a diagonal mass matrix')
    return diagonal
