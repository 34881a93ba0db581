"""The planar model in another multibody program, exudyn, at the same accuracy: ``make bench-deps``.

Exudyn integrates one object of generic coordinates (carriage; x and z of every axle). Its force is
a compiled user function: the twin's own law, taken at one instant (time step 0), parameters frozen
into it. Implicit solvers get a compiled sparse Jacobian by differences of three colours. Lateral
motion, which acts on nothing, is left out. For each solver the largest step is looked for with
which the force of every link, 0 to 20 Hz, stays within the bars of the time step; the fastest of
all is then run in turns with the twin.
"""

from collections.abc import Callable
from contextlib import redirect_stdout
import importlib.util
import io
import json
import struct
import sys
from typing import Any, NamedTuple
import warnings

from numba import njit
import numpy as np

from benchmarks.measure import alone, least, load, MACHINE, Result, spent
from benchmarks.simulation import CASE, CASE_NAME, RATE_HZ, START_S_M
from escalator_twin.machine import load_machine
from escalator_twin.physics import chain, run
from escalator_twin.physics.contact import end_forces, saturating
from escalator_twin.physics.kernel import CARRIAGE_CREEP_M_S
from escalator_twin.physics.parameters import Parameters
from escalator_twin.physics.path import CARRIAGE
from escalator_twin.physics.rails import Rails
from escalator_twin.physics.rollout import Simulation, STEP_S
from escalator_twin.physics.state import State, TRAVEL
from escalator_twin.signals import Floats
from escalator_twin.twin import make_simulation
from escalator_twin.verification.convergence import CUTOFF_HZ, difference

SIMULATED_S = 6.0
REFERENCE_STEP_S = 1e-4
BARS_N = (3.0, 15.0)  # rms and largest error of a link's force
ROUNDS = 3
SHIFT = 1e-7  # of a coordinate, m, for the Jacobian
TWIN_STEPS_S = (2.5e-3, 5e-3 / 3, 1.25e-3, STEP_S)
EXPLICIT_STEPS_S = {
    'VelocityVerlet': [1.0 / n for n in range(2000, 3600, 100)],
    'ExplicitMidpoint': [1.0 / n for n in range(2000, 3600, 100)],
    'RK33': [1.0 / n for n in range(1400, 2600, 100)],
    'RK44': [1.0 / n for n in range(1100, 2200, 100)],
}
IMPLICIT_STEPS_S = [1e-3 * h for h in (5.0, 4.0, 3.0, 2.5, 2.25, 2.0, 1.75, 1.5, 1.25, 1.0, 0.5)]
IMPLICIT = ('TrapezoidalIndex2', 'GeneralizedAlpha')
TOLERANCES = (1e-2, 1e-3, 1e-6)

# as the twin's law: no interpreter lock, no branch at a division, no counted references
OPTIONS: dict[str, Any] = {'nogil': True, 'error_model': 'numpy', '_nrt': False}
compile_plain = njit(**OPTIONS)
compile_into = njit(**OPTIONS, inline='always')


@compile_plain
def law(
    p: Parameters, rails: Rails, state: State, q: Floats, v: Floats, full: tuple[Floats, Floats],
    out: Floats,
) -> None:  # fmt: skip
    """Write the force on carriage and axles; ``full`` is room for the twin's own coordinates."""
    place, rate = full
    n = state.s.shape[1]
    place[0], rate[0] = q[0], v[0]
    for i in range(n):
        for c in range(2):
            place[2 + 3 * i + c], rate[2 + 3 * i + c] = q[1 + 2 * i + c], v[1 + 2 * i + c]
    end_forces(p, rails, state, place, rate, rate, 0.0)
    chain.add_loads(state.force, state.s, p.load, p.length_m, p.load_from, p.load_to, p.load_ramp)
    chain.link_forces(state, (p.link_stiffness, p.link_damping, p.link_length), 0.0)
    out[0] = p.preload - p.carriage_stiffness * q[0] - p.carriage_damping * v[0]
    out[0] += state.reaction[0] - p.carriage_friction * saturating(v[0] / CARRIAGE_CREEP_M_S)
    for i in range(n):
        out[1 + 2 * i], out[2 + 2 * i] = state.force[0, 0, i], state.force[1, 0, i]


@compile_plain
def take(q: Floats, v: Floats, a: Floats, b: Floats) -> None:
    """Copy ``q`` to ``a`` and ``v`` to ``b``."""
    for i in range(len(q)):
        a[i], b[i] = q[i], v[i]


def pattern(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return rows and columns of what may differ from zero, in the order of the differences."""
    axles = [
        (1 + 2 * ((i + d) % n) + e, 1 + 2 * i + c)
        for colour in range(3)
        for c in range(2)
        for i in range(colour, n, 3)
        for d in (-1, 0, 1)
        for e in range(2)
    ]
    places = [(r, 0) for r in range(2 * n + 1)] + axles + [(0, j) for j in range(1, 2 * n + 1)]
    rows, columns = np.array(places).T
    return rows, columns


class Compiled(NamedTuple):
    """User functions; the state is two flat arrays, since each argument costs at each call."""

    force: Callable[..., None]  # (floats, ints, t, q, v, out)
    jacobian: Callable[..., None]  # (floats, ints, t, q, v, of q, of v, values)


def compile_law(p: Parameters, rails: Rails, n: int, travel_m: float) -> Compiled:
    """Freeze parameters into the compiled law."""

    @compile_into
    def part(floats, first, width):
        return floats[first * n : (first + width) * n]

    @compile_into
    def view(floats, ints):
        return State(
            part(floats, 0, 1), ints[:n].reshape(1, n), ints[n:].reshape(1, n),
            part(floats, 1, 1).reshape(1, n), part(floats, 2, 1).reshape(1, n),
            part(floats, 3, 1).reshape(1, n), part(floats, 4, 1).reshape(1, n),
            part(floats, 5, 1).reshape(1, n), part(floats, 6, 1), part(floats, 6, 1),
            part(floats, 7, 2).reshape(2, 1, n), part(floats, 9, 2).reshape(2, 1, n),
            part(floats, 11, 2).reshape(2, 1, n), part(floats, 13, 11).reshape(11, 1, n),
            part(floats, 24, 2).reshape(2, 1, n), part(floats, 26, 2).reshape(2, 1, n),
            part(floats, 28, 3).reshape(3, 1, n), part(floats, 31, 1)[:1],
            part(floats, 32, 2).reshape(1, 2, 1, n), part(floats, 34, 1)[:1].reshape(1, 1),
            part(floats, 35, 4).reshape(2, 2, 1, n), part(floats, 39, 7).reshape(7, 1, n),
        )  # fmt: skip

    @compile_plain
    def force(floats, ints, t, q, v, out):  # type: ignore[no-untyped-def]
        state = view(floats, ints)
        state.rack[TRAVEL] = travel_m + p.speed * t
        law(p, rails, state, q, v, (part(floats, 46, 4), part(floats, 50, 4)), out)

    @compile_plain
    def jacobian(floats, ints, t, q, v, of_q, of_v, values):  # type: ignore[no-untyped-def]
        state = view(floats, ints)
        state.rack[TRAVEL] = travel_m + p.speed * t
        full = part(floats, 46, 4), part(floats, 50, 4)
        base, moved, a, b = (
            part(floats, 54, 3)[: len(q)],
            part(floats, 57, 3)[: len(q)],
            part(floats, 60, 3)[: len(q)],
            part(floats, 63, 3)[: len(q)],
        )
        take(q, v, a, b)
        law(p, rails, state, q, v, full, base)
        step = SHIFT / max(of_q, 1e-2 * of_v)
        a[0] += step * of_q
        b[0] += step * of_v
        law(p, rails, state, a, b, full, moved)
        k = len(q)
        for r in range(k):
            values[r] = (base[r] - moved[r]) / step
        for colour in range(3):
            for c in range(2):
                take(q, v, a, b)
                for i in range(colour, n, 3):
                    a[1 + 2 * i + c] += step * of_q
                    b[1 + 2 * i + c] += step * of_v
                law(p, rails, state, a, b, full, moved)
                for i in range(colour, n, 3):
                    for d in (-1, 0, 1):
                        for e in range(2):
                            r = 1 + 2 * ((i + d) % n) + e
                            values[k] = (base[r] - moved[r]) / step
                            k += 1
        # the carriage feels the axles in its curve only
        for r in range(k, len(values)):
            values[r] = 0.0
        for i in range(n):
            if p.segments[state.segment[0, i], CARRIAGE] == 0.0:
                continue
            for c in range(2):
                take(q, v, a, b)
                a[1 + 2 * i + c] += step * of_q
                b[1 + 2 * i + c] += step * of_v
                law(p, rails, state, a, b, full, moved)
                values[k + 2 * i + c] = (base[0] - moved[0]) / step

    return Compiled(force, jacobian)


class Setting(NamedTuple):
    """How the other program is run."""

    solver: str
    step_s: float
    tolerance: float | None = None  # of Newton's method, relative; none for explicit solvers


class Peer:
    """The other program with the planar model, from the state that a simulation is in."""

    def __init__(self, exudyn: Any, simulation: Simulation) -> None:
        p, state = simulation.parameters, simulation.state
        self.exudyn, self.p, self.n = exudyn, p, state.s.shape[1]
        self.size = 2 * self.n + 1
        keep = [0, *(2 + 3 * i + c for i in range(self.n) for c in range(2))]
        # MuJoCo's velocity stands at the middle of the step before
        velocity = simulation.data.qvel + 0.5 * simulation.step_s * state.acceleration
        self.start = simulation.data.qpos[keep].copy(), velocity[keep].copy()
        self.travel_m = float(state.rack[TRAVEL])
        self.compiled = compile_law(p, simulation.rails, self.n, self.travel_m)
        self.begin = np.concatenate([state.segment[0], state.dog[0]])
        self.ints, self.floats = self.begin.copy(), np.zeros(66 * self.n)
        self.container = exudyn.SystemContainer()
        self.system = self.container.AddSystem()
        self.sensors = self._build(exudyn.itemInterface)

    def _build(self, items: Any) -> tuple[Any, Any]:
        """Add node, object and sensors."""
        size, kinds = self.size, self.exudyn.OutputVariableType
        mass = np.concatenate([[self.p.carriage_mass], np.repeat(self.p.end_mass[0], 2)])
        index = np.arange(size)
        node = self.system.AddNode(
            items.NodeGenericODE2(
                numberOfODE2Coordinates=size,
                referenceCoordinates=[0.0] * size,
                initialCoordinates=self.start[0].tolist(),
                initialCoordinates_t=self.start[1].tolist(),
            )
        )
        force, jacobian = self._user_functions()
        self.system.AddObject(
            items.ObjectGenericODE2(
                nodeNumbers=[node],
                massMatrix=self._sparse(np.column_stack([index, index, mass])),
                forceUserFunction=force,
                jacobianUserFunction=jacobian,
            )
        )
        sensors = tuple(
            self.system.AddSensor(
                items.SensorNode(
                    nodeNumber=node, outputVariableType=kind, storeInternal=True, writeToFile=False
                )
            )
            for kind in (kinds.Coordinates, kinds.Coordinates_t)
        )
        self.system.Assemble()
        return sensors[0], sensors[1]

    def _sparse(self, triplets: Floats) -> Any:
        matrix = self.exudyn.MatrixContainer()
        matrix.SetWithSparseMatrix(triplets, self.size, self.size)
        return matrix

    def _user_functions(self) -> tuple[Callable[..., Any], Callable[..., Any]]:
        """Return force and Jacobian as exudyn calls them: vectors come and go as lists."""
        floats, ints, size = self.floats, self.ints, self.size
        pack = struct.Struct(f'{size}d').pack_into  # the quickest way out of a list
        rooms = bytearray(8 * size), bytearray(8 * size)
        q, v = (np.frombuffer(room) for room in rooms)
        out = np.zeros(size)
        rows, columns = pattern(self.n)
        values, triplets = np.zeros(len(rows)), np.zeros((len(rows), 3))
        triplets[:, 0], triplets[:, 1] = rows, columns
        compiled_force, compiled_jacobian = self.compiled

        def force(_system: Any, t: float, _item: int, here: Any, rate: Any) -> list[float]:
            pack(rooms[0], 0, *here)
            pack(rooms[1], 0, *rate)
            compiled_force(floats, ints, t, q, v, out)
            return out.tolist()

        def jacobian(
            _system: Any, t: float, _item: int, here: Any, rate: Any, of_q: float, of_v: float
        ) -> Any:
            pack(rooms[0], 0, *here)
            pack(rooms[1], 0, *rate)
            compiled_jacobian(floats, ints, t, q, v, of_q, of_v, values)
            triplets[:, 2] = np.where(values == 0.0, sys.float_info.min, values)
            return self._sparse(triplets)

        return force, jacobian

    def solve(self, setting: Setting, duration_s: float = SIMULATED_S) -> None:
        """Run the model; its sensors keep the coordinates at 200 Hz."""
        self.ints[:] = self.begin
        settings = self.exudyn.SimulationSettings()
        integration, explicit = settings.timeIntegration, setting.tolerance is None
        integration.endTime = duration_s
        integration.numberOfSteps = round(duration_s / setting.step_s)
        integration.verboseMode = integration.stepInformation = 0
        settings.solutionSettings.writeSolutionToFile = False
        settings.solutionSettings.sensorsWritePeriod = 1.0 / RATE_HZ
        settings.linearSolver.solverType = self.exudyn.LinearSolverType.EigenSparse
        if explicit:
            integration.explicit.computeEndOfStepAccelerations = False
        else:
            integration.newton.useModifiedNewton = True
            integration.newton.relativeTolerance = setting.tolerance
            integration.newton.absoluteTolerance = 1e-2 * setting.tolerance
        kind = getattr(self.exudyn.DynamicSolverType, setting.solver)
        self.system.SolveDynamic(settings, solverType=kind)

    def course(self) -> Floats:
        """Return the rack's travel and the forces of all links of one side, one row a sample."""
        # columns: time, carriage, axles
        q, v = (np.asarray(self.system.GetSensorStoredData(one)) for one in self.sensors)
        p, pair = self.p, np.arange(self.n)
        ends = q[:, 2:].reshape(len(q), self.n, 2), v[:, 2:].reshape(len(q), self.n, 2)
        ahead = (pair + 1) % self.n
        apart, rates = (rows[:, ahead] - rows for rows in ends)
        length = np.hypot(*np.moveaxis(apart, 2, 0))
        rate = (apart * rates).sum(axis=2) / length
        tension = p.link_stiffness * (length - p.link_length) + p.link_damping * rate
        return np.column_stack([self.travel_m + p.speed * q[:, 0], 0.5 * tension])


def quietly(work: Callable[[], object]) -> None:
    """Run without what the other program prints."""
    with redirect_stdout(io.StringIO()), warnings.catch_warnings():
        warnings.simplefilter('ignore')
        work()


def error(course: Floats, reference: Floats) -> tuple[float, float]:
    """Return rms and largest error of the worst link's force, 0 to 20 Hz, N."""
    if not np.isfinite(course).all():
        return float('inf'), float('inf')
    rows = difference(reference, course, CUTOFF_HZ)
    return float(np.sqrt((rows**2).mean(axis=0)).max()), float(np.abs(rows).max())


def meets(found: tuple[float, float]) -> bool:
    """Tell whether an error is within the bars."""
    return all(value <= bar for value, bar in zip(found, BARS_N, strict=True))


def probes(n_links: int) -> np.ndarray:
    """Return what is recorded of the twin."""
    return np.array([(run.RACK, 0, 0), *((run.LINK_FORCE, i, 0) for i in range(n_links))])


def twin(step_s: float) -> Simulation:
    """Return the planar twin at speed."""
    simulation = make_simulation(load_machine(MACHINE), CASE, planar=True, step_s=step_s)
    simulation.start(START_S_M)
    return simulation


def largest(peer: Peer, settings: list[Setting], reference: Floats) -> Result | None:
    """Return the first of settings, the largest step first, that meets the bars."""
    for setting in settings:
        try:
            quietly(lambda s=setting: peer.solve(s))  # type: ignore[misc]
        except peer.exudyn.ExudynError:  # Newton's method failed
            continue
        found = error(peer.course(), reference)
        if meets(found):
            cost = spent(lambda s=setting: quietly(lambda: peer.solve(s)))  # type: ignore[misc]
            return {
                **setting._asdict(),
                'error_rms_n': found[0],
                'error_largest_n': found[1],
                'times_real_time': SIMULATED_S / cost.wall_s,
                'by_processor_time': SIMULATED_S / cost.processor_s,
            }
    return None


def largest_twin_step(reference: Floats) -> tuple[float, tuple[float, float]]:
    """Return the twin's largest step that meets the bars, and its error."""
    for step_s in TWIN_STEPS_S:
        simulation = twin(step_s)
        course = simulation.advance(SIMULATED_S, RATE_HZ, probes(len(reference[0]) - 1))
        found = error(course, reference)
        if meets(found):
            return step_s, found
    raise AssertionError(f'no step of {TWIN_STEPS_S} meets the bars')


def against_peer() -> Result:
    """Return the twin's speed over the other program's best, both at the same accuracy."""
    with redirect_stdout(io.StringIO()):
        sys.exudynFast = True  # type: ignore[attr-defined]
        import exudyn
        import exudyn.itemInterface
    simulation = twin(REFERENCE_STEP_S)
    n = simulation.state.s.shape[1]
    peer = Peer(exudyn, simulation)
    reference = simulation.advance(SIMULATED_S + 0.1, RATE_HZ, probes(n))
    quietly(lambda: peer.solve(Setting('RK44', REFERENCE_STEP_S)))
    agreement = error(peer.course(), reference[: round(SIMULATED_S * RATE_HZ)])
    reference = reference[: round(SIMULATED_S * RATE_HZ)]
    sought = [
        [Setting(solver, h) for h in steps] for solver, steps in EXPLICIT_STEPS_S.items()
    ] + [
        [Setting(solver, h, tolerance) for h in IMPLICIT_STEPS_S]
        for solver in IMPLICIT
        for tolerance in TOLERANCES
    ]
    found = [one for settings in sought if (one := largest(peer, settings, reference))]
    best = max(found, key=lambda one: one['by_processor_time'])
    setting = Setting(*(best[name] for name in Setting._fields))
    step_s, twin_error = largest_twin_step(reference)
    twins = [twin(STEP_S), twin(step_s)]
    sensors = load_machine(MACHINE).instruments.sensors
    works = [
        lambda: quietly(lambda: peer.solve(setting)),
        *(lambda s=s: s.trace(SIMULATED_S, RATE_HZ, sensors) for s in twins),
    ]
    costs = least(works, ROUNDS)
    ratios = [[costs[0][k] / cost[k] for k in range(2)] for cost in costs[1:]]
    return {
        'benchmark': 'planar_against_peer',
        'value': ratios[1][1],
        'by_wall_time': ratios[1][0],
        'at_default_step': ratios[0][1],
        'at_default_step_by_wall_time': ratios[0][0],
        'bars': {'value': 5.0, 'error_rms_n': BARS_N[0], 'error_largest_n': BARS_N[1]},
        'twin': {
            'step_s': step_s,
            'error_rms_n': twin_error[0],
            'error_largest_n': twin_error[1],
            'by_processor_time': SIMULATED_S / costs[2].processor_s,
            'default_step_s': STEP_S,
            'at_default_step_by_processor_time': SIMULATED_S / costs[1].processor_s,
        },
        'peer': f'exudyn {exudyn.__version__}',
        'best': {**best, 'by_processor_time': SIMULATED_S / costs[0].processor_s},
        'each_solver_at_its_largest_step': found,
        'same_model': {
            'what': f'RK44 at {REFERENCE_STEP_S} s against the twin at the same step',
            'rms_n': agreement[0],
            'largest_n': agreement[1],
        },
        'settings': {
            'case': CASE_NAME,
            'simulated_s': SIMULATED_S,
            'recorded_hz': RATE_HZ,
            'linear_solver': 'EigenSparse',
            'newton': 'modified, adaptive steps',
            'explicit': 'no accelerations at the end of a step, fast build',
        },
        'load': load(),
    }


def main() -> None:
    """Print the result as one line, or that the other program is not installed."""
    if importlib.util.find_spec('exudyn') is None:
        reason = 'exudyn is not installed: make bench-deps'
        print(json.dumps({'benchmark': 'planar_against_peer', 'skipped': reason}))
        return
    print(json.dumps(alone(against_peer)), flush=True)


if __name__ == '__main__':
    main()
