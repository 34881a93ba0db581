"""Run a chain: start from static equilibrium at any place, advance, record."""

from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np

from escalator_twin.errors import ExperimentError, MachineError
from escalator_twin.machine import Machine, Sensor
from escalator_twin.physics import run
from escalator_twin.physics.mjcall import address_of
from escalator_twin.physics.model import compiled_model, mass_diagonal
from escalator_twin.physics.parameters import Parameters, SIDES
from escalator_twin.physics.path import GuidePath
from escalator_twin.physics.rails import make_rails, Rails
from escalator_twin.physics.start import find_rest, NEARLY_STILL, set_off, STILL
from escalator_twin.physics.state import make_state, TIME, TRAVEL
from escalator_twin.signals import Floats

STEP_S = 1e-3
SETTLE_S = 3.0  # after setting off at speed: several times the carriage's decay time
MARGIN_PITCHES = 0.3
AXES = {'x': run.ACCEL_X, 'y': run.ACCEL_Y, 'z': run.ACCEL_Z}


def probe_of(sensor: Sensor, n_links: int) -> tuple[int, int, int]:
    """Return (kind, index, side) of what a sensor sees in the model.

    Raises
    ------
    MachineError
        Where the quantity is unknown or its place is not in the machine.
    """
    at = sensor.at

    def place(key: str) -> int:
        value = at.get(key)
        if not isinstance(value, int) or not 0 <= value < n_links:
            raise MachineError(
                f'{sensor.channel}: at.{key}: expected 0 to {n_links - 1}, found {value!r}'
            )
        return value

    def side() -> int:
        if at.get('side') not in SIDES:
            raise MachineError(
                f'{sensor.channel}: at.side: expected left or right, found {at.get("side")!r}'
            )
        return SIDES.index(str(at['side']))

    if sensor.quantity == 'link_force':
        return run.LINK_FORCE, place('link'), side()
    if sensor.quantity == 'roller_normal_force':
        return run.ROLLER_NORMAL, place('axle'), side()
    if sensor.quantity == 'carriage_displacement':
        return run.CARRIAGE, 0, 0
    if sensor.quantity == 'step_acceleration':
        if at.get('axis') not in AXES:
            raise MachineError(
                f'{sensor.channel}: at.axis: expected x, y or z, found {at.get("axis")!r}'
            )
        return AXES[str(at['axis'])], place('step'), 0
    raise MachineError(
        f'{sensor.channel}: quantity: expected link_force, roller_normal_force, '
        f'carriage_displacement or step_acceleration, found {sensor.quantity!r}'
    )


@dataclass(frozen=True)
class Trace:
    """What a run recorded on an even grid from its start.

    Attributes
    ----------
    time_s : (n,) float64
    columns : (n, k) float64
        One column a probe, SI.
    place_m : (n,) float64
        Path coordinate of axle 0, mean of both sides, unwrapped in time.
    rack_m : float
        The rack's travel at the start, signed, m, a dog counted as a pitch: where its dogs stand,
        modulo the pitch.
    """

    time_s: Floats
    columns: Floats
    place_m: Floats
    rack_m: float = 0.0


class Kept(NamedTuple):
    """Where a simulation stood."""

    parameters: Parameters
    given: Parameters
    rails: Rails
    data: tuple[float, Floats, Floats, Floats]  # time, coordinates, velocities, accelerations
    state: tuple[np.ndarray, ...]


class Simulation:
    """A chain in motion; owns MuJoCo's model and data.

    Parameters
    ----------
    machine : Machine
    parameters : Parameters
        From ``make_parameters``, deviations applied.
    path : GuidePath
        The guide that ``parameters`` was made with.
    step_s : float
        Time step, s.
    visual : bool
        Give the MuJoCo model shapes, for a viewer.
    full_step : bool
        Let MuJoCo run its whole ``mj_step``. Otherwise it only integrates: its forward pass would
        find from the applied forces the very accelerations that the law has just found. It then
        runs once at the end of every ``advance``, for whoever looks at the data.
    """

    def __init__(
        self,
        machine: Machine,
        parameters: Parameters,
        path: GuidePath,
        step_s: float = STEP_S,
        visual: bool = False,
        full_step: bool = False,
    ) -> None:
        self.machine, self.parameters, self.path, self.step_s = machine, parameters, path, step_s
        self._given = parameters  # phases as given, for every start
        self.rails = make_rails(parameters)
        gauge = machine.chain.track_gauge_m / 2.0
        self.model = compiled_model(
            parameters, step_s, gauge, machine.roller.diameter_m / 2.0, visual
        )
        self.data = mujoco.MjData(self.model)
        mujoco.mj_forward(self.model, self.data)
        sides, axles = parameters.end_mass.shape
        self.state = make_state(sides, axles, self.model.nv, 2 if parameters.frame[0] > 0.0 else 1)
        mass = mass_diagonal(self.model, self.data)
        self.host = run.Host(
            self.data.qpos, self.data.qvel, self.data.qacc, self.data.qfrc_applied,
            mass, mass * self.model.jnt_axis[:, 2] * parameters.gravity,
            address_of('mj_step' if full_step else 'mj_Euler'),
            self.model._address, self.data._address,
        )  # fmt: skip

    @property
    def time_s(self) -> float:
        """Time since the start, s."""
        return float(self.state.rack[TIME])

    @property
    def chain_speed_m_s(self) -> float:
        """Mean speed of the chain: a pitch for every dog of the rack or seat of the wheel."""
        return self.parameters.speed * self.dog_pitch

    @property
    def dog_pitch(self) -> float:
        """Travel of the chain over that of the rack: seats of a wheel lie further than a pitch."""
        return self.parameters.pitch_m / self.parameters.dog_spacing

    def start(self, start_s_m: float, settle_s: float = SETTLE_S, is_exact: bool = True) -> None:
        """Put axle 0 at a path coordinate, at speed, transients gone.

        The machine is brought to static equilibrium with its rack held, one settling way before
        the place asked for, set off with every part at the rack's speed, and run until axle 0
        (mean of both sides) is there to within half a step's way; or, where ``is_exact`` is false,
        is near there.

        Raises
        ------
        ExperimentError
            Where the place is not on the loop or the equilibrium cannot be found.
        """
        # before the run begins it is as late as there
        p = self.parameters = self._given._replace(lateness=self._given.lateness[:1])
        if not 0.0 <= start_s_m < self.path.length_m:
            raise ExperimentError(
                f'start_s: expected 0 to {self.path.length_m:.4f} m, found {start_s_m!r}'
            )
        way = self.chain_speed_m_s * settle_s
        rest = find_rest(
            p, self.rails, self.state, self.path, (start_s_m - way) % self.path.length_m, -way,
            STILL if is_exact else NEARLY_STILL,
        )  # fmt: skip
        self.data.qpos[:] = rest
        self._shift_phases(self.state.rack[TRAVEL] + p.speed * settle_s, settle_s)
        set_off(p, self.state, self.data.qvel, self.chain_speed_m_s)
        if settle_s > 0.0:
            # axle 0 runs ahead of the rack or behind it by the polygon's share of a pitch
            margin = MARGIN_PITCHES * p.pitch_m / abs(p.speed)
            self.advance(max(settle_s - margin, 0.0), 1.0, np.zeros((0, 3), np.int64))
            if is_exact:
                self._run_to(start_s_m, 3.0 * margin)
        self._shift_phases(0.0, -self.time_s)
        self.parameters = self.parameters._replace(lateness=self._given.lateness)
        self.state.rack[TIME] = 0.0
        self.data.time = 0.0

    def keep(self) -> Kept:
        """Return where the simulation stands, to come back to."""
        data = (
            self.data.time,
            self.data.qpos.copy(),
            self.data.qvel.copy(),
            self.data.qacc.copy(),
        )
        return Kept(
            self.parameters,
            self._given,
            self.rails,
            data,
            tuple(part.copy() for part in self.state),
        )

    def back_to(self, kept: Kept) -> None:
        """Stand again where a simulation of the same machine stood."""
        self.parameters, self._given, self.rails = kept.parameters, kept.given, kept.rails
        self.data.time = kept.data[0]
        self.data.qpos[:], self.data.qvel[:], self.data.qacc[:] = kept.data[1:]
        for part, value in zip(self.state, kept.state, strict=True):
            part[:] = value

    def lay(self, rail: Floats) -> None:
        """Add a deviation to the guide's normal one: (n, 2), m and its slope, on the same grid."""
        survey = self._given.survey
        if survey.shape[1:] != rail.shape:
            raise ExperimentError(
                f'rail: expected {survey.shape[1]} points of value and slope, found {rail.shape}'
            )
        self.parameters = self._given = self._given._replace(survey=survey + rail)
        self.rails = make_rails(self._given)

    def keep_time(self, lateness_s: Floats, step_s: float) -> None:
        """Let what hunts in time keep the clock of a machine whose speed wanders.

        Parameters
        ----------
        lateness_s : (n,) float64
            By how much later than this run, whose speed is even, that machine came where this one is, s; from
            the run's start on.
        step_s : float
            From one to the next.
        """
        self.parameters = self._given = self._given._replace(
            lateness=np.asarray(lateness_s, np.float64), lateness_step=float(step_s)
        )

    def _shift_phases(self, travel_m: float, time_s: float) -> None:
        """Make the phases given for a travel and a time of 0 hold at these instead."""
        p = self.parameters
        if not len(p.ripple) + len(p.hunting):
            return
        ripple, hunting = p.ripple.copy(), p.hunting.copy()
        ripple[:, 2] -= 2.0 * np.pi * ripple[:, 1] * travel_m / p.pitch_m
        hunting[:, 2] -= 2.0 * np.pi * hunting[:, 1] * time_s
        self.parameters = p._replace(ripple=ripple, hunting=hunting)

    def _run_to(self, start_s_m: float, limit_s: float) -> None:
        """Advance until axle 0 is at a place, to within half a step's way."""
        half_loop = 0.5 * self.path.length_m
        half_way = 0.5 * abs(self.parameters.speed) * self.step_s
        for _ in range(round(limit_s / self.step_s)):
            here = self.axle_place(0)
            ahead = (start_s_m - here + half_loop) % self.path.length_m - half_loop
            if ahead * np.sign(self.parameters.speed) <= half_way:
                return
            self.advance(self.step_s, 1.0, np.zeros((0, 3), np.int64))
        raise ExperimentError(f'start_s: axle 0 did not come to {start_s_m} m')

    def axle_place(self, axle: int) -> float:
        """Return the path coordinate of an axle, mean of both sides, at the present state."""
        total = 0.0
        sides = self.state.s.shape[0]
        first = self.state.s[0, axle]
        for side in range(sides):
            total += (self.state.s[side, axle] - first + 1.0) % self.path.length_m - 1.0
        ahead = self.state.speed[:, axle].mean() * self.step_s
        return float((first + total / sides + ahead) % self.path.length_m)

    def advance(self, duration_s: float, rate_hz: float, probes: np.ndarray) -> Floats:
        """Run for a while and record at an even rate, the first row at the present state.

        Parameters
        ----------
        duration_s : float
            Rounded to whole steps.
        rate_hz : float
            Must divide the step rate.
        probes : (k, 3) int64
            Rows (kind, index, side), see ``run``.

        Returns
        -------
        record : (n, k) float64

        Raises
        ------
        ExperimentError
            Where the rate does not divide the step rate, or the simulation diverges.
        """
        n_steps = round(duration_s / self.step_s)
        stride = max(1, round(1.0 / (rate_hz * self.step_s)))
        if abs(stride * rate_hz * self.step_s - 1.0) > 1e-6:
            raise ExperimentError(
                f'rate: expected one that divides {1.0 / self.step_s:.6g} Hz, found {rate_hz} Hz'
            )
        width = run.width_of(probes, self.machine.chain.n_links)
        record = np.zeros((-(-n_steps // stride), width))
        run.advance(
            self.parameters, self.rails, self.state, self.host, self.step_s, n_steps, stride,
            probes, record,
        )  # fmt: skip
        mujoco.mj_forward(self.model, self.data)
        if not np.isfinite(self.data.qpos).all():
            raise ExperimentError(f'the simulation diverged before {self.time_s:.3f} s')
        return record

    def trace(self, duration_s: float, rate_hz: float, sensors: tuple[Sensor, ...]) -> Trace:
        """Run and record sensors beside the way of axle 0."""
        n = self.machine.chain.n_links
        probes = np.array([probe_of(s, n) for s in sensors] + [(run.PLACE, 0, 0)], dtype=np.int64)
        rack = float(self.state.rack[TRAVEL]) * self.dog_pitch
        record = self.advance(duration_s, rate_hz, probes)
        length = self.path.length_m
        place = np.unwrap(record[:, -1], period=length)
        return Trace(np.arange(len(record)) / rate_hz, record[:, :-1], place, rack)
