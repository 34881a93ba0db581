"""One recording, placed in the loop and ready to be diagnosed."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from escalator_twin.causes.application import apply
from escalator_twin.comparison.judge import judge, Judgement
from escalator_twin.comparison.locate import locate, Setting
from escalator_twin.diagnosis.floor import Floor
from escalator_twin.diagnosis.knobs import knobs_of, turn_all
from escalator_twin.diagnosis.loops import Frame
from escalator_twin.diagnosis.nuisance import make_nuisance
from escalator_twin.diagnosis.observation import observe, on_grid
from escalator_twin.diagnosis.regression import Fitted
from escalator_twin.diagnosis.responses import find_knobs, find_responses, Progress, Responses
from escalator_twin.diagnosis.stage import make_stage, run_beside, Stage
from escalator_twin.diagnosis.whitening import make_whitener
from escalator_twin.machine import Deviation, Machine
from escalator_twin.physics.rollout import Trace
from escalator_twin.signals import Floats, Recording

TUNING = 3  # steps
TUNED_SHARE = 0.02  # of chi squared: a step that gains less ends the tuning


@dataclass(frozen=True)
class Context:
    """A recording's place, the responses of its experiment, and the twin's floor.

    Attributes
    ----------
    recording : Recording
    machine : Machine
        As described.
    setting : Setting
    responses : Responses
    floor : Floor
    start_m : float
        Travel from path coordinate 0 of axle 0 to where the twin's run begins.
    """

    recording: Recording
    machine: Machine
    setting: Setting
    responses: Responses
    floor: Floor
    start_m: float

    @property
    def frame(self) -> Frame:
        """The grid, at the recording's own speed."""
        return replace(self.responses.frame, speed_m_s=self.setting.experiment.set_speed_m_s)


@dataclass(frozen=True)
class Beside:
    """A machine beside a recording, aligned anew.

    Attributes
    ----------
    stage : Stage
    judgement : Judgement
    model : (n, c) float64
        On the stage's grid.
    fitted : Fitted
        What it leaves, with the nuisance.
    """

    stage: Stage
    judgement: Judgement
    model: Floats
    fitted: Fitted


def prepare(
    recording: Recording,
    machine: Machine,
    floor: Floor,
    jobs: int = 1,
    progress: Progress | None = None,
    setting: Setting | None = None,
    responses: Responses | None = None,
) -> Context:
    """Place a recording and find the responses of its experiment.

    Raises
    ------
    RecordingError, SynchronisationError
        Where it cannot be placed.
    """
    setting = setting or locate(recording, machine)
    if responses is None:
        responses = find_responses(machine, setting.experiment, jobs, progress)
    return Context(recording, machine, setting, responses, floor, _start(setting, responses))


def _start(setting: Setting, responses: Responses) -> float:
    """Return the travel in the responses' loop at which the twin's run begins."""
    frame, base = responses.frame, responses.base
    direction = setting.experiment.direction
    way = direction * np.append(base.place_m, base.place_m[0] + base.rolled_m)
    length = abs(base.rolled_m)
    target = way[0] + (direction * setting.start_s_m - way[0]) % length
    grid = np.arange(frame.n_loop + 1) * frame.spacing_m
    return float(np.interp(target, way, grid))


def beside(
    context: Context,
    deviations: tuple[Deviation, ...] = (),
    trace: Trace | None = None,
    steps: int = TUNING,
    turned: Mapping[str, float] | None = None,
) -> Beside:
    """Run a machine with deviations beside the recording and align both anew.

    Parameters
    ----------
    context : Context
    deviations : tuple of Deviation
        Of the machine; those of the measurement do nothing here.
    trace : Trace, optional
        Of that machine, where it was run already.
    steps : int
        By which the tolerances are tuned at most.
    turned : mapping of tolerance to float, optional
        Where the tuning begins, standard deviations.
    """
    machine = apply(context.machine, deviations)
    setting = context.setting
    sizes = dict(turned or {})
    if trace is None:
        knobs = knobs_of(machine, setting.experiment)
        trace = run_beside(*turn_all(machine, setting.experiment, knobs, sizes), setting)
    place = _aligned(context, machine, trace, sizes)
    for _ in range(steps):
        trial = place.stage.tuned(place.fitted)
        again = _aligned(context, machine, trial.trace(), trial.turned)
        gained = place.fitted.chi2 - again.fitted.chi2
        if gained > 0.0:
            place = again
        if gained < TUNED_SHARE * place.fitted.chi2:
            break
    return place


def _aligned(
    context: Context, machine: Machine, trace: Trace, turned: Mapping[str, float]
) -> Beside:
    """Align a recording with a run, and fit what it leaves."""
    setting = context.setting
    judgement = judge(setting, trace, machine, with_scores=False)
    observation = observe(setting, judgement, machine, context.frame, context.start_m)
    columns = {s.channel: i for i, s in enumerate(machine.instruments.sensors)}
    model = on_grid(trace, setting.experiment.set_speed_m_s, observation, columns)
    nuisance = make_nuisance(observation, model, context.responses, machine)
    whiten = make_whitener(observation, machine, context.floor)
    stage = make_stage(machine, setting, observation, nuisance, whiten, trace.rack_m)
    stage = replace(stage, turned=dict(turned))
    return Beside(stage, judgement, model, stage.fit(model))


def with_own_tolerances(
    context: Context, deviations: tuple[Deviation, ...], jobs: int = 1
) -> Context:
    """Return the context whose tolerances act as in the machine with deviations."""
    machine = apply(context.machine, deviations)
    speed = context.responses.frame.speed_m_s
    knobs = find_knobs(machine, context.setting.experiment, speed, jobs)
    return replace(context, responses=replace(context.responses, knobs=knobs))
