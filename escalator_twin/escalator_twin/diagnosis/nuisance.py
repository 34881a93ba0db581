"""What is never an effect: tolerances, zeros, gains, drifts, poses, course and clocks."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline, make_lsq_spline
from scipy.spatial.transform import Rotation

from escalator_twin.causes.imperfections import creep_shape
from escalator_twin.causes.registry import KNOWN
from escalator_twin.diagnosis.observation import Observation, slope_along
from escalator_twin.diagnosis.responses import Responses
from escalator_twin.diagnosis.tolerances import WANDER
from escalator_twin.machine import Machine
from escalator_twin.signals import Floats

COURSE_M = 0.01  # of travel: what the first alignment may have left, one standard deviation
COURSE_KNOT_S = 8.0
WANDER_KNOT_S = 10.0  # a third of the shortest period that a good drive's wander has
MOST_WANDER = (
    0.005  # of the speed, twice a good drive's and more: beyond, the travel is not yet aligned
)
SHIFT_M = 0.05  # of travel as a whole
CLOCK_S = 2e-3  # of the reference's clock by bag time
CLOCK_RATE = 5e-6
FREE = 1e3  # standard deviations that leave a number free
THERMAL_SHARE = 0.25  # of the largest thermal drift: a mean of gauges, in each smooth shape
# Curvatures of a good gauge's creep: with the thermal shapes these span those between and beyond.
CREEPS = (1.5, 5.0)
CREEP = '/creep/'  # between a channel and a shape's curvature, in the names of such nuisance
AXES = 'xyz'
TURNED = 'turned/beyond_first_order'  # never freed: no effect of the measurement stands for it


@dataclass(frozen=True)
class Nuisance:
    """Columns with unit prior variance.

    Attributes
    ----------
    names : tuple of str
        One a column; a tolerance's is its key path.
    columns : (n, c, q) float32
        Change of the signals by one standard deviation.
    """

    names: tuple[str, ...]
    columns: np.ndarray


def make_nuisance(
    observation: Observation,
    model: Floats,
    responses: Responses,
    machine: Machine,
    own: Mapping[str, np.ndarray] | None = None,
) -> Nuisance:
    """Return all that may differ between a good machine, well measured, and the twin.

    Parameters
    ----------
    observation : Observation
    model : (n, c) float64
        The twin on the observation's grid.
    responses : Responses
    machine : Machine
    own : mapping of tolerance to (n, c) float32, optional
        What it does, in the place of what the responses say.
    """
    wrapped = observation.index % observation.frame.n_loop
    order = _positions(observation, machine)
    knobs = {name: found[wrapped][:, order] for name, found in responses.knobs.items()}
    if WANDER in knobs:
        knobs[WANDER] = knobs[WANDER] * wander(observation)[:, None]
    return nuisance_of(observation, model, {**knobs, **(own or {})}, machine)


def wander(observation: Observation) -> np.ndarray:
    """Return by which share of it the machine was faster than its mean speed, slowly, (n,) float32.

    The twin runs at an even speed, and a recording is laid beside it by travel. But how strongly the chain
    rings with the polygon's forces is a matter of how fast these follow each other: near a resonance a
    thousandth of the speed shows.
    """
    seconds = observation.travel_m / observation.frame.speed_m_s
    late = observation.time_s.mean(axis=1) - seconds
    span = seconds[-1] - seconds[0]
    inner = np.linspace(seconds[0], seconds[-1], max(2, round(span / WANDER_KNOT_S) + 1))
    knots = np.concatenate([[seconds[0]] * 3, inner, [seconds[-1]] * 3])
    faster = -make_lsq_spline(seconds, late, knots, 3).derivative()(seconds)
    found: np.ndarray = np.clip(faster - faster.mean(), -MOST_WANDER, MOST_WANDER).astype(
        np.float32
    )
    return found


def nuisance_of(
    observation: Observation,
    model: Floats,
    knobs: Mapping[str, np.ndarray],
    machine: Machine,
    zeros: Mapping[str, float] | None = None,
) -> Nuisance:
    """Return the nuisance from what one standard deviation of every tolerance does, (n, c).

    ``zeros`` gives one standard deviation of the mean of the channels whose mean says something.
    """
    n, c = model.shape
    known = zeros or {}
    names: list[str] = []
    columns: list[np.ndarray] = []

    def add(name: str, values: np.ndarray, channel: int | None = None) -> None:
        whole = np.zeros((n, c), np.float32)
        if channel is None:
            whole[:] = values
        else:
            whole[:, channel] = values
        names.append(name)
        columns.append(whole)

    for name, response in knobs.items():
        add(name, response)
    for name, change in shifts(observation, model, machine).items():
        add(name, change)
    seconds = observation.travel_m / observation.frame.speed_m_s
    part = (seconds - seconds[0]) / (seconds[-1] - seconds[0])
    for k, channel in enumerate(observation.channels):
        sensor = machine.instruments.sensor(channel)
        own = model[:, k] - model[:, k].mean()
        if sensor.gain_tol > 0.0:
            add(f'{channel}/gain', sensor.gain_tol * own, k)
        if sensor.thermal_drift > 0.0:
            size = THERMAL_SHARE * sensor.thermal_drift * abs(sensor.scale)
            for wave, shape in enumerate(_slow(part)):
                add(f'{channel}/drift/{wave}', size * shape, k)
            size = creep_tol() * abs(sensor.scale)
            for bend in CREEPS:
                add(f'{creep_of(channel)}{bend:g}', size * creep_shape(part, bend), k)
    for name, turned in rotations(observation, model, machine).items():
        add(name, turned)
    for k, channel in enumerate(observation.channels):
        if channel in known:
            add(f'{channel}/zero', np.full(n, known[channel]), k)
        elif machine.instruments.sensor(channel).rotation_tol_deg > 0.0:
            add(f'{channel}/zero', np.full(n, FREE * 1e-3), k)
        else:
            add(f'{channel}/zero', np.full(n, FREE * max(float(np.std(model[:, k])), 1e-9)), k)
    return Nuisance(tuple(names), np.stack(columns, axis=2))


def creep_of(channel: str) -> str:
    """Return how the names begin of what a good gauge may creep by."""
    return f'{channel}{CREEP}'


def creep_tol() -> float:
    """Return one standard deviation of a good gauge's creep over a recording, m/m."""
    return next(p.tolerance or 0.0 for p in KNOWN['gauge_drift'].parameters if p.name == 'strain')


def shifts(observation: Observation, model: Floats, machine: Machine) -> dict[str, Floats]:
    """Return what course and clocks do to a model that is sampled a little off, (n, c) each."""
    speed = observation.frame.speed_m_s
    slope = slope_along(model, observation.frame.spacing_m)
    found: dict[str, Floats] = {'course': SHIFT_M * slope}
    seconds = observation.travel_m / speed
    for k, bump in enumerate(_bumps(seconds)):
        found[f'course/{k}'] = COURSE_M * slope * bump[:, None]
    reference = machine.instruments.channels_of(machine.instruments.reference_logger)
    ground = np.array([channel in reference for channel in observation.channels], float)
    middle = seconds - seconds.mean()
    if 0.0 < ground.sum() < len(ground):
        found['clock'] = CLOCK_S * speed * slope * ground
        found['clock/rate'] = CLOCK_RATE * speed * slope * ground * middle[:, None]
    return found


def _positions(observation: Observation, machine: Machine) -> list[int]:
    """Return where the observation's channels are among the machine's sensors."""
    every = [s.channel for s in machine.instruments.sensors]
    return [every.index(channel) for channel in observation.channels]


def _bumps(seconds: Floats) -> Floats:
    """Return cubic B-splines over time, (k, n)."""
    start, end = seconds[0], seconds[-1]
    inner = np.linspace(start, end, max(2, round((end - start) / COURSE_KNOT_S) + 1))
    knots = np.concatenate([[start] * 3, inner, [end] * 3])
    design: Floats = BSpline.design_matrix(np.clip(seconds, start, end), knots, 3).toarray().T
    return design


def _slow(part: Floats) -> list[Floats]:
    """Return smooth shapes over a recording, each between -1 and 1."""
    return [
        2.0 * part - 1.0,
        np.cos(np.pi * part),
        np.cos(2.0 * np.pi * part),
        np.sin(2.0 * np.pi * part),
        np.cos(3.0 * np.pi * part),
    ]


def rotations(observation: Observation, model: Floats, machine: Machine) -> dict[str, np.ndarray]:
    """Return what turning the accelerometer does, by one standard deviation about each axis.

    A sensor turned by the small right-hand rotation w reads a - w x a. By how much more a sensor reads
    that is turned by what the comparison found is a column of its own: at 4 degrees that is 0.24 % of
    gravity, which changes along the loop by more than a minute's noise.
    """
    axes: dict[str, int] = {}
    tolerance = 0.0
    for k, channel in enumerate(observation.channels):
        sensor = machine.instruments.sensor(channel)
        if sensor.quantity == 'step_acceleration':
            axes[str(sensor.at['axis'])] = k
            tolerance = np.deg2rad(sensor.rotation_tol_deg)
    if not axes or tolerance == 0.0:
        return {}
    a = np.zeros((len(model), 3))
    for axis, k in axes.items():
        a[:, AXES.index(axis)] = model[:, k]
    changes = {
        f'rotation/{x}': -np.cross(w, a) for x, w in zip(AXES, tolerance * np.eye(3), strict=True)
    }
    turn = np.array(observation.rotation_rad)
    changes[TURNED] = Rotation.from_rotvec(turn).inv().apply(a) - a + np.cross(turn, a)
    turned = {}
    for name, change in changes.items():
        whole = np.zeros(model.shape, np.float32)
        for axis, k in axes.items():
            whole[:, k] = change[:, AXES.index(axis)]
        # a planar machine's sensor is not seen to turn out of its plane
        if name == TURNED or whole.any():
            turned[name] = whole
    return turned
