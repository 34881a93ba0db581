"""Run a machine of free bodies: from rest at any place, at speed or through a start-up, recorded."""

from dataclasses import dataclass

import mujoco
import numpy as np

from escalator_twin.errors import ExperimentError
from escalator_twin.machine import Sensor
from escalator_twin.machine.multibody import MultibodyMachine
from escalator_twin.physics.mjcall import address_of
from escalator_twin.physics.multibody import loop
from escalator_twin.physics.multibody.layout import Layout, pose, RELAX_RATE
from escalator_twin.physics.multibody.model import build_spec, check_mass, count, Counts
from escalator_twin.physics.multibody.network import make_memory
from escalator_twin.physics.multibody.probes import probe_of
from escalator_twin.physics.rollout import Trace
from escalator_twin.signals import Floats

RELAX_S = 1.0
NO_PROBES = np.zeros((0, 3), np.int64)


@dataclass(frozen=True)
class Loop:
    """The closed way of axle 0."""

    length_m: float


class MultibodySimulation:
    """Steps, handrail or both in motion; owns MuJoCo's model and data.

    Parameters
    ----------
    machine : MultibodyMachine
    layout : Layout
        From ``lay_out``, deviations applied.
    step_s : float, optional
        Time step, s; by default the description's.
    """

    def __init__(
        self, machine: MultibodyMachine, layout: Layout, step_s: float | None = None
    ) -> None:
        self.machine, self.layout, self.network = machine, layout, layout.network
        self.step_s = step_s or machine.time_step_s
        self.model = build_spec(self.network, self.step_s).compile()
        self.data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self.data)
        check_mass(self.model, self.data, self.network)
        self.memory = make_memory(self.network)
        self.host = loop.Host(
            self.data.qpos, self.data.qvel, self.data.qacc,
            address_of('mj_Euler'), self.model._address, self.data._address,
        )  # fmt: skip
        track = layout.steps.chain if layout.steps else layout.handrail and layout.handrail.track
        assert track
        self.path = Loop(track.length_m)

    @property
    def counts(self) -> Counts:
        """What the built model holds."""
        return count(self.model, self.network)

    @property
    def time_s(self) -> float:
        """Time since the start, s."""
        return float(self.memory.clock[0])

    @property
    def speed_m_s(self) -> float:
        """Speed asked for, signed."""
        drive = self.machine.drive
        pitch = self.machine.chain.pitch_m * drive.seats / (2.0 * np.pi)
        return float(self.network.rotor[0, 0]) * (
            pitch if self.layout.steps else float(self.network.rotor[0, 1])
        )

    def rest(self, start_s_m: float) -> None:
        """Put axle 0 near a path coordinate and let everything come to rest, rotors held."""
        if not 0.0 <= start_s_m < self.path.length_m:
            raise ExperimentError(
                f'start_s: expected 0 to {self.path.length_m:.4f} m, found {start_s_m!r}'
            )
        q, angles = pose(self.layout, self.machine, start_s_m)
        self.memory = make_memory(self.network)
        self.memory.rotor[:, 0] = angles
        velocity = np.zeros(len(q))
        n_steps = round(RELAX_S / self.step_s)
        loop.relax(self.network, self.memory, q, velocity, self.step_s, n_steps, RELAX_RATE)
        if not np.isfinite(q).all():
            raise ExperimentError(f'no rest was found with axle 0 at {start_s_m:.3f} m')
        self.data.qpos[:], self.data.qvel[:] = q, 0.0
        self.memory.acceleration[:] = 0.0
        self.memory.clock[:] = 0.0

    def start(self, start_s_m: float) -> None:
        """Put axle 0 at a path coordinate, at speed, transients gone.

        Raises
        ------
        ExperimentError
            Where the place is not on the loop, or no rest or no run to it is found.
        """
        drive = self.machine.drive
        lead = self.speed_m_s * (0.5 * drive.start_up_s + drive.settle_s)
        if not 0.0 <= start_s_m < self.path.length_m:
            raise ExperimentError(
                f'start_s: expected 0 to {self.path.length_m:.4f} m, found {start_s_m!r}'
            )
        self.rest((start_s_m - lead) % self.path.length_m)
        n_steps = round(drive.start_up_s / self.step_s)
        self._run(n_steps, n_steps, NO_PROBES, drive.start_up_s)
        self._run_to(start_s_m)
        self.memory.clock[0] = 0.0

    def _run_to(self, start_s_m: float) -> None:
        """Advance until axle 0 is at a place, to within a step's way."""
        half, way = 0.5 * self.path.length_m, abs(self.speed_m_s) * self.step_s
        sign = np.sign(self.speed_m_s)
        for _ in range(1000):
            ahead = (start_s_m - self.memory.s[0] + half) % self.path.length_m - half
            ahead = sign * ahead if sign * ahead > -0.25 * half else sign * ahead + 2.0 * half
            n_steps = int(0.8 * ahead / way)
            if n_steps <= 1:
                return
            self._run(n_steps, n_steps, NO_PROBES, 0.0)
        raise ExperimentError(f'start_s: axle 0 did not come to {start_s_m} m')

    def _run(self, n_steps: int, stride: int, probes: np.ndarray, ramp_s: float) -> Floats:
        record = np.zeros((-(-n_steps // stride), len(probes)))
        if ramp_s <= 0.0:
            self.memory.clock[2] = 1.0
        loop.advance(
            self.network, self.memory, self.host, self.step_s, n_steps, stride, probes, record,
            ramp_s,
        )  # fmt: skip
        if not np.isfinite(self.data.qpos).all():
            raise ExperimentError(f'the simulation diverged before {self.time_s:.3f} s')
        return record

    def advance(
        self, duration_s: float, rate_hz: float, probes: np.ndarray, ramp_s: float = 0.0
    ) -> Floats:
        """Run for a while and record at an even rate, each row a mean over its interval.

        Parameters
        ----------
        duration_s : float
            Rounded to whole steps.
        rate_hz : float
            Must divide the step rate.
        probes : (k, 3) int64
            Rows (kind, index, sub-index), see ``loop``.
        ramp_s : float
            Of a start-up from time 0; 0 runs at speed.
        """
        n_steps = round(duration_s / self.step_s)
        stride = max(1, round(1.0 / (rate_hz * self.step_s)))
        if abs(stride * rate_hz * self.step_s - 1.0) > 1e-6:
            raise ExperimentError(
                f'rate: expected one that divides {1.0 / self.step_s:.6g} Hz, found {rate_hz} Hz'
            )
        return self._run(n_steps, stride, probes, ramp_s)

    def trace(self, duration_s: float, rate_hz: float, sensors: tuple[Sensor, ...]) -> Trace:
        """Run and record sensors beside the way of axle 0."""
        found = [probe_of(s, self.machine, self.layout) for s in sensors]
        probes = np.array([p for p, _ in found] + [(loop.POINT_PLACE, 0, 0)], dtype=np.int64)
        record = self.advance(duration_s, rate_hz, probes)
        columns = record[:, :-1] * np.array([scale for _, scale in found])
        place = np.unwrap(record[:, -1], period=self.path.length_m)
        return Trace(np.arange(len(record)) / rate_hz, columns, place)
