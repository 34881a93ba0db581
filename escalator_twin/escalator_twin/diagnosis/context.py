"""One recording, placed in the loop and ready to be diagnosed."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from escalator_twin.causes.application import apply
from escalator_twin.comparison.exchanged import exchanged
from escalator_twin.comparison.judge import judge, Judgement
from escalator_twin.comparison.locate import Setting
from escalator_twin.diagnosis.floor import Floor
from escalator_twin.diagnosis.grids import Begin, Frame, Origin
from escalator_twin.diagnosis.knobs import knobs_of, turn_all
from escalator_twin.diagnosis.loops import LOCAL
from escalator_twin.diagnosis.nuisance import make_nuisance
from escalator_twin.diagnosis.observation import Observation, observe, on_grid
from escalator_twin.diagnosis.regression import Fitted
from escalator_twin.diagnosis.responses import Responses
from escalator_twin.diagnosis.stage import make_stage, run_beside, Stage
from escalator_twin.diagnosis.tolerances import find_knobs, KNOB_STEP, RAIL
from escalator_twin.diagnosis.view import NO_PROBES, View
from escalator_twin.diagnosis.whitening import make_whitener
from escalator_twin.machine import Deviation, Machine
from escalator_twin.physics.rollout import Trace
from escalator_twin.signals import Finding, Floats, Recording

TUNING = 3  # steps
TUNED_SHARE = 0.02  # of chi squared: a step that gains less ends the tuning
STEP_SHARES = (1.0, 0.4)
FAR_TURNED = 0.7  # standard deviations from which a tolerance may act otherwise


@dataclass(frozen=True)
class Own:
    """What tolerances do to a machine with effects of single links, run beside one recording.

    Attributes
    ----------
    index : (n,) int64
        Grid points of the observation that it was run beside.
    columns : mapping of tolerance to (n, c) float32
        By one standard deviation.
    """

    index: np.ndarray
    columns: Mapping[str, np.ndarray]

    def at(self, index: np.ndarray) -> dict[str, np.ndarray]:
        """Return the columns at other grid points: an alignment moves the ends by a few."""
        rows = np.clip(index - self.index[0], 0, len(self.index) - 1)
        return {name: found[rows] for name, found in self.columns.items()}


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
    place : Beside or None
        The machine as described, its tolerances tuned.
    nominal : Nominal or None
        The same with no tolerance turned.
    weak : frozenset of str
        Tolerances that hardly show in this recording: what they do is not taken anew.
    own : Own or None
        In the place of what ``responses`` says of tolerances.
    """

    recording: Recording
    machine: Machine
    setting: Setting
    responses: Responses
    floor: Floor
    start_m: float
    place: 'Beside | None' = None
    nominal: 'Nominal | None' = None
    weak: frozenset[str] = frozenset()
    own: Own | None = None

    @property
    def frame(self) -> Frame:
        """The grid, at the recording's own speed."""
        return replace(self.responses.frame, speed_m_s=self.setting.experiment.set_speed_m_s)

    @property
    def begin(self) -> Begin:
        """Where travel is counted from: every machine that is run beside the recording begins there."""
        return Begin(self.setting.start_s_m, self.start_m)


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


@dataclass(frozen=True)
class Nominal:
    """The machine as described beside a recording, no tolerance turned.

    Attributes
    ----------
    place : Beside
    responses : Responses
        With what the tolerances do there.
    """

    place: Beside
    responses: Responses


def beside(
    context: Context,
    deviations: tuple[Deviation, ...] = (),
    steps: int = TUNING,
    turned: Mapping[str, float] | None = None,
    start: Beside | None = None,
) -> Beside:
    """Run a machine with deviations beside the recording and align both anew.

    Parameters
    ----------
    context : Context
    deviations : tuple of Deviation
        Of the machine; those of the measurement do nothing here.
    steps : int
        By which the tolerances are tuned at most.
    turned : mapping of tolerance to float, optional
        Where the tuning begins, standard deviations.
    start : Beside, optional
        That machine there, where it was aligned already.
    """
    machine = apply(context.machine, deviations)
    setting = context.setting
    place = start
    if place is None:
        sizes = dict(turned or {})
        knobs = knobs_of(machine, setting.experiment)
        trace = run_beside(*turn_all(machine, setting.experiment, knobs, sizes), setting)
        place = _aligned(context, machine, trace, sizes)
    for _ in range(steps):
        after = _step(context, machine, place)
        if after is None:
            break
        gained, place = quiet_chi2(place) - quiet_chi2(after), after
        if gained < TUNED_SHARE * quiet_chi2(place):
            break
    return place


def _step(context: Context, machine: Machine, place: Beside) -> Beside | None:
    """Turn the tolerances by a step, or by a part of it, that explains more; None without one."""
    before = quiet_chi2(place)
    for share in STEP_SHARES:
        trial = place.stage.tuned(place.fitted, share)
        after = _aligned(context, machine, trial.trace(), trial.turned)
        if quiet_chi2(after) < before:
            return after
    return None


def quiet_chi2(place: Beside) -> float:
    """Return chi squared without the channels that rattling rollers shake by chance."""
    return place.stage.judged(place.fitted)


def _aligned(
    context: Context, machine: Machine, trace: Trace, turned: Mapping[str, float]
) -> Beside:
    """Align a recording with a run, and fit what it leaves."""
    setting = context.setting
    judgement = judge(setting, trace, machine, with_scores=False)
    observation = observe(setting, judgement, machine, context.frame, context.start_m)
    columns = {s.channel: i for i, s in enumerate(machine.instruments.sensors)}
    model = on_grid(trace, setting.experiment.set_speed_m_s, observation, columns)
    own = {} if context.own is None else context.own.at(observation.index)
    nuisance = make_nuisance(observation, model, context.responses, machine, own)
    shares = shares_of(context, observation)
    noises = noises_of(setting.findings)
    whiten = make_whitener(observation, machine, context.floor, shares=shares, noises=noises)
    stage = make_stage(machine, setting, observation, nuisance, whiten, trace.rack_m)
    stage = replace(stage, turned=dict(turned))
    return Beside(stage, judgement, model, stage.fit(model))


def noises_of(findings: Sequence[Finding]) -> dict[str, float]:
    """Return the noise of repaired channels, times a sound one's, by where their signals are compared."""
    right = exchanged(findings)
    return {right.get(f.channel, f.channel): f.noise for f in findings if f.noise > 1.0}


def shares_of(context: Context, observation: Observation) -> Floats:
    """Return where in the loop, 0 to 1, the step of each channel is, (n, c); 0 without a step."""
    direction = context.setting.experiment.direction
    view = View(observation, context.responses, direction, NO_PROBES)
    length = abs(context.responses.base.length_m)
    shares = np.zeros(observation.measured.shape)
    for k, channel in enumerate(observation.channels):
        step = context.machine.instruments.sensor(channel).at.get('step')
        if step is not None:
            # a step spans a pitch from its axle on
            middle = view.place_of(int(str(step))) + 0.5 * observation.frame.pitch_m
            shares[:, k] = middle % length / length
    return shares


def with_own_tolerances(
    context: Context,
    deviations: tuple[Deviation, ...],
    jobs: int = 1,
    turned: Mapping[str, float] | None = None,
    step: float = KNOB_STEP,
    with_rails: bool = True,
    origin: Origin = None,
) -> Context:
    """Return the context whose tolerances act as in the machine with deviations.

    A deviation of one link, axle or step, or a wave of the drive, changes next to nothing of that and
    is left out: the rest is the same machine after every pitch, and quickly run.
    ``turned`` holds the tolerances that it has used up, standard deviations; ``step`` is by how
    much more each is turned. Without rails, what these do is kept. ``origin`` is that of travel
    (`simulate_loop`), ``begin`` without: that of this machine's own run beside the recording.
    """
    machine = apply(context.machine, tuple(d for d in deviations if d.cause not in LOCAL))
    experiment = context.setting.experiment
    turned_machine, setting = turn_all(
        machine, experiment, knobs_of(machine, experiment), turned or {}
    )
    speed = context.responses.frame.speed_m_s
    knobs = find_knobs(
        turned_machine, setting, speed, jobs, context.weak, step, with_rails,
        context.begin if origin is None else origin,
    )  # fmt: skip
    kept = {
        k: v for k, v in context.responses.knobs.items() if not (with_rails and k.startswith(RAIL))
    }
    knobs = {**kept, **knobs}
    return replace(context, responses=replace(context.responses, knobs=knobs), own=None)
