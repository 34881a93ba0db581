"""The MuJoCo model of a network: every body on two slides and a hinge; parts; rotors."""

from dataclasses import dataclass

import mujoco
import numpy as np

from escalator_twin.physics.model import AXES, OFF
from escalator_twin.physics.multibody.network import Network, P_MASS, P_X, P_Z

ANGLE = (0.0, -1.0, 0.0)  # turns x towards z
ARENA_PER_BODY = 1 << 11  # bytes: MuJoCo's own stack grows with the bodies


def build_spec(n: Network, step_s: float) -> mujoco.MjSpec:
    """Return the ``MjSpec`` of a network in the coordinates of its force law."""
    spec = mujoco.MjSpec()
    spec.modelname = 'planar_multibody'
    option = spec.option
    option.timestep = step_s
    option.integrator = mujoco.mjtIntegrator.mjINT_EULER
    option.gravity = (0.0, 0.0, -n.gravity)
    for flag in OFF:
        option.disableflags |= getattr(mujoco.mjtDisableBit, flag)
    spec.memory = (1 << 20) + ARENA_PER_BODY * (len(n.mass) + len(n.rotor))
    spec.compiler.autolimits = False
    slide, hinge = mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE
    world = spec.worldbody

    def body(name: str, mass: float, inertia: float) -> mujoco.MjsBody:
        return world.add_body(
            name=name, mass=mass, inertia=[inertia] * 3, ipos=[0, 0, 0], explicitinertial=True
        )

    for i in range(len(n.mass)):
        one = body(f'body_{i}', n.mass[i], n.inertia[i])
        for axis in ('x', 'z'):
            one.add_joint(name=f'body_{i}_{axis}', type=slide, axis=AXES[axis])
        one.add_joint(name=f'body_{i}_angle', type=hinge, axis=ANGLE)
    for p in range(len(n.part)):
        row = n.part[p]
        one = body(f'part_{p}', row[P_MASS], row[P_MASS])
        one.add_joint(name=f'part_{p}', type=slide, axis=(row[P_X], 0.0, row[P_Z]))
    for r in range(len(n.rotor)):
        body(f'rotor_{r}', 1.0, 1.0).add_joint(name=f'rotor_{r}', type=hinge, axis=ANGLE)
    return spec


def check_mass(model: mujoco.MjModel, data: mujoco.MjData, n: Network) -> None:
    """Raise an AssertionError where MuJoCo's mass matrix is not that of the network."""
    mass = np.zeros(model.nv)
    # M times a vector of ones, and times one of growing numbers: equal to the diagonal's only
    # where nothing stands beside it
    masses = np.stack([n.mass, n.mass, n.inertia], axis=1).ravel()
    expected = np.concatenate([masses, n.part[:, P_MASS], np.ones(len(n.rotor))])
    for vector in (np.ones(model.nv), 1.0 + np.arange(model.nv) % 7.0):
        mujoco.mj_mulM(model, data, mass, vector)
        if np.abs(mass - expected * vector).max() > 1e-9 * expected.max():
            raise AssertionError('the force law needs a diagonal mass matrix, the bodies alone')


@dataclass(frozen=True)
class Counts:
    """What a built model holds.

    Attributes
    ----------
    bodies : int
        Free bodies.
    degrees_of_freedom : int
        Independent ones: the model's, without the rotors that turn as they are told.
    spring_dampers : int
    contact_pairs : int
    """

    bodies: int
    degrees_of_freedom: int
    spring_dampers: int
    contact_pairs: int

    def line(self) -> str:
        """Return the counts as text."""
        return (
            f'{self.bodies} bodies, {self.degrees_of_freedom} degrees of freedom, '
            f'{self.spring_dampers} spring-dampers, {self.contact_pairs} contact pairs'
        )


def count(model: mujoco.MjModel, n: Network) -> Counts:
    """Count a built model; the pairs are those that the search goes through."""
    joints = np.bincount(model.jnt_bodyid, minlength=model.nbody)
    return Counts(
        bodies=int(np.count_nonzero(joints == 3)),
        degrees_of_freedom=int(model.nv - len(n.rotor)),
        spring_dampers=len(n.link) + len(n.bush),
        contact_pairs=int((n.point_rows[:, 1] - n.point_rows[:, 0]).sum()),
    )
