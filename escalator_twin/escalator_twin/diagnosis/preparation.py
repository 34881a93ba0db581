"""Place a recording, tune the machine to it, and find what every cause would do there."""

from dataclasses import replace

import numpy as np

from escalator_twin.comparison.locate import locate, Setting
from escalator_twin.diagnosis.context import beside, Context, Nominal
from escalator_twin.diagnosis.floor import Floor
from escalator_twin.diagnosis.knobs import knobs_of, RACKING, turn_all
from escalator_twin.diagnosis.responses import (
    find_responses,
    Responses,
    tolerances_only,
)
from escalator_twin.diagnosis.simultaneous import Progress
from escalator_twin.diagnosis.stage import Stage
from escalator_twin.diagnosis.tuning import tuned, tuned_on
from escalator_twin.diagnosis.unexplained import is_open, SIGMAS
from escalator_twin.machine import Machine
from escalator_twin.signals import Recording

WEAK = 2.0  # chi squared of one standard deviation


def prepare(
    recording: Recording,
    machine: Machine,
    floor: Floor,
    jobs: int = 1,
    progress: Progress | None = None,
    setting: Setting | None = None,
) -> Context:
    """Place a recording, tune the machine within its tolerances, find what every cause does to it.

    Raises
    ------
    RecordingError, SynchronisationError
        Where the recording cannot be placed.
    """
    context = prepare_tolerances(recording, machine, floor, jobs, setting)
    start = beside(context, steps=0)
    nominal = Nominal(start, context.responses)
    context = replace(context, weak=_weak(start.stage))
    context, place = tuned(context, jobs=jobs, start=start)
    if is_open(place, floor, SIGMAS):
        context, place = tuned_on(context, place, jobs)
    experiment = context.setting.experiment
    knobs = knobs_of(machine, experiment)
    turned_machine, turned = turn_all(machine, experiment, knobs, place.stage.turned)
    responses = find_responses(
        turned_machine, turned, context.responses.knobs, jobs, progress, context.begin
    )
    return replace(context, responses=responses, place=place, nominal=nominal)


def _weak(stage: Stage) -> frozenset[str]:
    """Return the tolerances of which one standard deviation hardly shows.

    How stiff an axle is between its sides shows with every effect of one side.
    """
    power = np.sum(stage.white_nuisance**2, axis=0)
    knobs = {knob.name for knob in stage.knobs}
    return frozenset(
        name
        for name, p in zip(stage.nuisance.names, power, strict=True)
        if name in knobs and p < WEAK and name != RACKING
    )


def prepare_tolerances(
    recording: Recording,
    machine: Machine,
    floor: Floor,
    jobs: int = 1,
    setting: Setting | None = None,
) -> Context:
    """Place a recording and find what the tolerances of the machine as described do.

    Raises
    ------
    RecordingError, SynchronisationError
        Where it cannot be placed.
    """
    setting = setting or locate(recording, machine)
    responses = tolerances_only(machine, setting.experiment, jobs)
    start = start_in(setting, responses)
    return Context(recording, machine, setting, responses, floor, start)


def start_in(setting: Setting, responses: Responses) -> float:
    """Return the travel in the responses' loop at which the twin's run begins."""
    frame, base = responses.frame, responses.base
    direction = setting.experiment.direction
    way = direction * np.append(base.place_m, base.place_m[0] + base.length_m)
    length = abs(base.length_m)
    target = way[0] + (direction * setting.start_s_m - way[0]) % length
    grid = np.arange(frame.n_loop + 1) * frame.spacing_m
    return float(np.interp(target, way, grid))
