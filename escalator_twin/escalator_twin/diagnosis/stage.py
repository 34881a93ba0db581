"""One recording beside a machine that is known so far: run it, compare it, fit what is left."""

from dataclasses import dataclass, replace

import numpy as np

from escalator_twin.causes.application import apply
from escalator_twin.comparison.locate import RATE_HZ, Setting
from escalator_twin.diagnosis.floor import is_shaken, SHAKING
from escalator_twin.diagnosis.grids import rack_shift
from escalator_twin.diagnosis.knobs import Knob, knobs_of, turn_all
from escalator_twin.diagnosis.loops import alike, built
from escalator_twin.diagnosis.nuisance import Nuisance, shifts
from escalator_twin.diagnosis.observation import Observation, on_grid
from escalator_twin.diagnosis.regression import fit, Fitted, swapped
from escalator_twin.diagnosis.whitening import Whitener
from escalator_twin.machine import Deviation, Machine
from escalator_twin.physics.path import build_path
from escalator_twin.physics.periodic import run_periodic
from escalator_twin.physics.rollout import Trace
from escalator_twin.signals import Experiment, Floats
from escalator_twin.twin import run_twin

LATENESS_STEP_S = 0.1  # of a course whose knots are further apart
LARGEST = 2.5  # standard deviations that a tolerance is turned by; what is beyond is an effect's


@dataclass(frozen=True)
class Stage:
    """A recording, what it is compared with, and how that is weighed.

    Attributes
    ----------
    machine : Machine
        As described, with the deviations accepted so far.
    setting : Setting
    observation : Observation
    nuisance : Nuisance
    whiten : Whitener
    knobs : tuple of Knob
    turned : mapping of knob name to float
        Tolerances that the model holds, standard deviations.
    rack_m : float
        Of the run that the recording was aligned with, see ``rack_shift``.
    added : (n, c) float64 or None
        To every run, on the observation's grid: see ``lean``.
    """

    machine: Machine
    setting: Setting
    observation: Observation
    nuisance: Nuisance
    whiten: Whitener
    white_nuisance: np.ndarray
    knobs: tuple[Knob, ...]
    turned: dict[str, float]
    rack_m: float
    added: Floats | None = None

    @property
    def machine_length(self) -> float:
        """Length of the design path, m."""
        return build_path(self.machine.guide).length_m

    @property
    def origin(self) -> float:
        """From where travel is counted in every run of this stage, see `simulate_loop`."""
        return self.setting.experiment.direction * self.rack_m - self.observation.start_m

    @property
    def tolerances(self) -> dict[str, float]:
        """One standard deviation of every tolerance that a cause's parameter may stand for."""
        return {
            **self.machine.tolerances,
            'experiment.preload_n': self.machine.tensioner.preload_tol,
            'guide.upper_landing_m': self.machine.guide.landing_tol_m,
        }

    @property
    def offset(self) -> Floats:
        """Sizes of the nuisance that the model holds, (q,)."""
        return np.array([self.turned.get(name, 0.0) for name in self.nuisance.names])

    def run(self, deviations: tuple[Deviation, ...] = (), without: str | None = None) -> Floats:
        """Simulate the machine with more deviations, on the observation's grid, (n, c).

        ``without`` names a tolerance that is not turned: the deviation stands for it.
        """
        model = self.on_grid(self.trace(deviations, without))
        return model if self.added is None else model + self.added

    def lean(self, model: Floats) -> 'Stage':
        """Return a stage on which further effects are tried at little cost.

        What effects of single links do to the model is run no more but added to every run: beside
        them the machine is the same after every pitch. To first order a further effect does the same
        with them as without.

        Parameters
        ----------
        model : (n, c) float64
            Of this stage.
        """
        alone, _ = alike(self.machine, self.setting.experiment)
        if len(alone.deviations) == len(self.machine.deviations):
            return self
        lean = replace(self, machine=alone)
        return replace(lean, added=model - lean.run())

    def trace(self, deviations: tuple[Deviation, ...] = (), without: str | None = None) -> Trace:
        """Simulate the machine with more deviations."""
        sizes = {k: v for k, v in self.turned.items() if k != without}
        machine, experiment = turn_all(self.machine, self.setting.experiment, self.knobs, sizes)
        return run_beside(apply(machine, deviations), experiment, self.setting)

    def rolled_at_start(self) -> Floats:
        """Return the way that every axle's rollers have rolled at a run's first sample, m, (n_links,).

        About none: rollers begin a settling way before, and pass curves and carriage on it.
        """
        machine, experiment = turn_all(
            self.machine, self.setting.experiment, self.knobs, self.turned
        )
        simulation = built(machine, experiment)
        simulation.start(self.setting.start_s_m)
        rolled: Floats = simulation.state.roll.mean(axis=0)
        return rolled

    def on_grid(self, trace: Trace) -> Floats:
        """Put a run onto the observation's grid, (n, c)."""
        columns = {s.channel: i for i, s in enumerate(self.machine.instruments.sensors)}
        speed = self.setting.experiment.set_speed_m_s
        experiment = self.setting.experiment
        shift = rack_shift(
            experiment.direction * trace.rack_m,
            experiment.direction * self.rack_m,
            self.observation.frame.pitch_m,
        )
        return on_grid(trace, speed, self.observation, columns, shift)

    def allowed(self, sizes: Floats) -> Floats:
        """Return sizes of the nuisance, (q,), as held-out samples may be explained by them."""
        return sizes

    @property
    def told_by_mean(self) -> frozenset[str]:
        """Channels whose mean counts: it is no zero of the instrument."""
        return frozenset()

    def residual(self, model: Floats) -> Floats:
        """Return measured less simulated, means removed, (n, c)."""
        difference = self.observation.measured - model
        valid = self.observation.valid
        count = np.maximum(valid.sum(axis=0), 1)
        centred: Floats = difference - np.where(valid, difference, 0.0).sum(axis=0) / count
        return centred

    def white(self, model: Floats) -> np.ndarray:
        """Return the whitened residual, (m,)."""
        white: np.ndarray = self.whiten(self.residual(model)[:, :, None])[:, 0]
        return white

    def fit(self, model: Floats) -> Fitted:
        """Fit the nuisance to what a model leaves."""
        return fit(self.white(model), self.white_nuisance, self.offset)

    def fit_shifted(self, model: Floats, before: Fitted) -> Fitted:
        """Fit the nuisance to what a model leaves, course and clocks shifting that model.

        They are kept as they were aligned with another model; ``before`` is a fit of this stage. Beside
        that model's slopes, what moves a resonance by a part of its width seems to explain nothing.
        """
        return swapped(before, self.white(model), *self.shifts(model), self.offset)

    def shifts(self, model: Floats) -> tuple[list[int], np.ndarray]:
        """Return where course and clocks are in the nuisance, and what they do to a model, whitened."""
        found = shifts(self.observation, model, self.machine)
        at = [self.nuisance.names.index(name) for name in found]
        return at, self.whiten(np.stack(list(found.values()), axis=2))

    @property
    def quiet(self) -> np.ndarray:
        """Which channels no rattling shakes, (c,) bool."""
        sensors = [self.machine.instruments.sensor(c) for c in self.observation.channels]
        return np.array([not is_shaken(sensor) for sensor in sensors])

    def judged(self, fitted: Fitted, cause: str | None = None) -> float:
        """Return the chi squared that a cause is judged by: of the channels that it acts on."""
        if cause in SHAKING:
            return fitted.chi2
        return self.level(fitted.left(), fitted.sizes + fitted.offset)

    def level(self, left: np.ndarray, used: Floats) -> float:
        """Return chi squared in the channels that no rattling shakes.

        ``left`` (m,) is what is left there, whitened; ``used`` (q,) are the sizes of the nuisance.
        """
        rows = left.astype(np.float64).reshape(-1, len(self.observation.channels))
        return float(np.sum(rows[:, self.quiet] ** 2) + used @ used)

    def columns(self, changes: np.ndarray, cause: str) -> np.ndarray:
        """Whiten what a cause changes, (n, c, p), in the channels that it acts on."""
        if cause not in SHAKING:
            changes = changes * self.quiet[None, :, None]
        white: np.ndarray = self.whiten(changes)
        return white

    def tuned(self, fitted: Fitted, share: float = 1.0) -> 'Stage':
        """Return the stage whose model holds the fitted tolerances, or a share of the step."""
        sizes = self.offset + share * fitted.sizes
        names = {knob.name for knob in self.knobs}
        turned = {
            name: float(np.clip(size, -LARGEST, LARGEST))
            for name, size in zip(self.nuisance.names, sizes, strict=True)
            if name in names
        }
        return replace(self, turned=turned)

    def up_to(self, cut_hz: float | None) -> 'Stage':
        """Return the stage that compares waves up to a frequency; None: as they are."""
        if cut_hz is None:
            return self
        gain = self.whiten.low_pass(cut_hz, self.observation.frame.rate_hz)
        whiten = replace(self.whiten, weight=self.whiten.weight * gain[:, None])
        q = self.white_nuisance.shape[1]
        rows = self.white_nuisance.reshape(len(gain), -1, q) * gain[:, None, None]
        return replace(self, whiten=whiten, white_nuisance=rows.reshape(-1, q))

    def extended(self, deviations: tuple[Deviation, ...]) -> 'Stage':
        """Return the stage whose machine has more deviations."""
        return replace(self, machine=apply(self.machine, deviations))


def run_beside(machine: Machine, experiment: Experiment, setting: Setting) -> Trace:
    """Run a machine as a recording ran, at even speed; what hunts in time keeps the recording's."""
    args = machine.instruments.sensors, setting.start_s_m, setting.duration_s, RATE_HZ
    trace = run_periodic(built(machine, experiment), *args)
    if trace is not None:
        return trace
    simulation = built(machine, experiment)
    if len(simulation.parameters.hunting):
        simulation.keep_time(lateness_of(setting), LATENESS_STEP_S)
    return run_twin(simulation, *args)


def lateness_of(setting: Setting) -> Floats:
    """Return by how much later the recording came where an even run is, s, every `LATENESS_STEP_S`.

    Less its mean: a wave's phase is that of an even run on the whole.
    """
    span = setting.duration_s
    # the recording is a little longer or shorter than the run
    time = np.arange(-0.1 * span, 1.1 * span, LATENESS_STEP_S)
    even = np.arange(0.0, span + LATENESS_STEP_S, LATENESS_STEP_S)
    there = np.interp(even * setting.experiment.set_speed_m_s, setting.travel.at(time), time)
    lateness = there - even
    found: Floats = lateness - lateness.mean()
    return found


def make_stage(
    machine: Machine,
    setting: Setting,
    observation: Observation,
    nuisance: Nuisance,
    whiten: Whitener,
    rack_m: float,
) -> Stage:
    """Return the stage of a machine as described."""
    return Stage(
        machine, setting, observation, nuisance, whiten, whiten(nuisance.columns),
        knobs_of(machine, setting.experiment), {}, rack_m,
    )  # fmt: skip
