"""One recording's diagnosis, from the bag's signals to the numbers of contracts.md."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from escalator_twin.causes.registry import CAUSES
from escalator_twin.comparison.document import recording_document
from escalator_twin.comparison.judge import judge
from escalator_twin.diagnosis.context import Context, prepare
from escalator_twin.diagnosis.faults import Fault, faults_of
from escalator_twin.diagnosis.floor import load_floor
from escalator_twin.diagnosis.free import of_machine
from escalator_twin.diagnosis.heldout import HeldOut, hold_out
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.stage import run_beside
from escalator_twin.diagnosis.unexplained import look, Unexplained
from escalator_twin.diagnosis.verdict import ALIKE, Weighed
from escalator_twin.diagnosis.walk import Found, walk, Walked
from escalator_twin.errors import NotYetError
from escalator_twin.machine import Deviation, Machine
from escalator_twin.signals import Recording

ENOUGH = 0.5  # of the energy above the floor that the effects must account for to be named
NAMED = 0.5  # probability from which an effect is told as accepted
REFUSED = 0.3  # of the probability, where nothing is gained held out or a channel becomes worse
LAW_ERROR = 0.02  # of a size: what the twin's law is off by, one standard deviation
MOST_CANDIDATES = 20
NORMAL_95 = 1.96
Progress = Callable[[float, float], None]
STAGES = 10.0


@dataclass(frozen=True)
class Diagnosis:
    """What was found in one recording.

    Attributes
    ----------
    document : mapping
        The recording's part of the comparison, before extension.
    effects : list of mapping
        Accepted, strongest first, as contracts.md tells them.
    candidates : list of mapping
    unexplained : Unexplained
    deviations : tuple of Deviation
        Accepted effects of the machine.
    held_out : HeldOut or None
        None where nothing was accepted.
    faults : tuple of Fault
    found : tuple of (Found, probability)
        All effects that the walk accepted, named or not.
    """

    document: dict[str, Any]
    effects: list[dict[str, Any]]
    candidates: list[dict[str, Any]]
    unexplained: Unexplained
    deviations: tuple[Deviation, ...]
    held_out: HeldOut | None
    faults: tuple[Fault, ...]
    found: tuple[tuple[Found, float], ...] = ()


def diagnose_recording(
    recording: Recording,
    machine: Machine,
    seed: int = 0,
    jobs: int = 1,
    progress: Progress | None = None,
) -> Diagnosis:
    """Diagnose one recording.

    Parameters
    ----------
    recording : Recording
    machine : Machine
    seed : int
        Of the bootstrap; nothing else is drawn.
    jobs : int
        Simulations at a time.
    progress : callable, optional
        Gets (done, total).
    """

    def tell(done: float, total: float) -> None:
        if progress is not None:
            progress(1.0 + 5.0 * done / total, STAGES)

    if not hasattr(machine.guide, 'channel_clearance_m'):
        raise NotYetError(f'diagnose: {machine.name}: not yet for machines of {machine.physics}')
    context = prepare(recording, machine, load_floor(machine), jobs, tell)
    trace = run_beside(machine, context.setting.experiment, context.setting)
    judgement = judge(context.setting, trace, machine)
    document = recording_document(recording, context.setting, judgement, machine)
    walked = walk(context, jobs)
    if progress is not None:
        progress(9.0, STAGES)
    faults = tuple(faults_of(context.setting, machine))
    rest = look(context, walked.before, walked.after)
    named, held = settle(context, walked, rest, seed)
    if progress is not None:
        progress(STAGES, STAGES)
    effects = [told(found, p) for found, p in named if p >= NAMED]
    effects += [told_fault(fault) for fault in faults]
    kept = [found.proposal for found, p in named if p >= NAMED and of_machine(found.proposal)]
    return Diagnosis(
        document,
        sorted(effects, key=lambda e: -e['probability']),
        _candidates(walked, named, faults),
        rest,
        tuple(proposal.deviation for proposal in kept),
        held,
        faults,
        tuple(named),
    )


def settle(
    context: Context, walked: Walked, rest: Unexplained, seed: int
) -> tuple[list[tuple[Found, float]], HeldOut | None]:
    """Decide which effects are named, by what they explain and by what they gain held out.

    Returns
    -------
    named : list of (Found, probability)
    held : HeldOut or None
    """
    if not walked.found:
        return [], None
    effects = [f.proposal for f in walked.found]
    held = hold_out(context, walked.after, effects, seed, walked.before.stage.turned)
    factor = 1.0
    if rest.significant and rest.explained < 1.0:
        # what stays open speaks against the names, the more of it the more
        factor *= float(np.clip(rest.explained / ENOUGH - 0.5, 0.0, 1.0)) ** 0.5
    if held.channels is not None and (held.worse or not held.significant):
        factor *= REFUSED
    if held.channels is None:
        factor *= 0.95  # no second look
    return [(found, found.probability * factor) for found in walked.found], held


def told(found: Found, probability: float) -> dict[str, Any]:
    """Return an effect as contracts.md tells it."""
    proposal = found.proposal
    cause = CAUSES[proposal.cause]
    parameters = {}
    for parameter in cause.parameters:
        if parameter.name not in proposal.parameters or parameter.name in HIDDEN:
            continue
        if (proposal.cause, parameter.name) in SHAPES:
            continue
        value = proposal.parameters[parameter.name]
        half = NORMAL_95 * _spread(found, parameter.name, value)
        parameters[parameter.name] = {
            'value': value,
            'low': max(value - half, parameter.low),
            'high': min(value + half, parameter.high),
        }
    return {
        'cause': proposal.cause,
        'location': _place(proposal),
        'parameters': parameters,
        'probability': min(probability, 0.99),
        'alternatives': alternatives(found),
    }


HIDDEN = {'phase_rad', 'curvature'}
SHAPES = {('guide_step', 'length_m')}  # not among the numbers of contracts.md


def _spread(found: Found, name: str, value: float) -> float:
    """Return one standard deviation of a parameter: fit, tolerance of the own value, law."""
    proposal = found.proposal
    parameter = next(p for p in CAUSES[proposal.cause].parameters if p.name == name)
    sd = found.sd.get(name, 0.0)
    neutral = parameter.neutral if parameter.neutral is not None else value
    size = value - neutral if np.isfinite(neutral) else 0.0
    tolerance = parameter.tolerance or 0.0
    # a factor multiplies the machine's own value
    tolerance *= value if parameter.name == 'factor' else 0.5
    return float(np.sqrt(sd**2 + tolerance**2 + (LAW_ERROR * size) ** 2))


def _place(proposal: Proposal) -> dict[str, Any]:
    place = dict(proposal.location)
    for key, value in place.items():
        if isinstance(value, float):
            place[key] = round(value, 3)
    return place


def alternatives(found: Found) -> list[str]:
    """Return the causes that the data cannot tell apart from an accepted one."""
    own = found.proposal
    names = []
    best = max((w.evidence for w in found.rivals), default=0.0)
    for rival in found.rivals:
        name = rival.proposal.cause
        if name != own.cause and rival.evidence > best - ALIKE and name not in names:
            names.append(name)
    if own.cause == 'rolling_resistance' and own.parameters['factor'] > 1.0:
        names.append('friction_speed')  # at one speed the same
    return names[:3]


def told_fault(fault: Fault) -> dict[str, Any]:
    return {
        'cause': fault.cause,
        'location': dict(fault.location),
        'parameters': {
            name: {'value': value, 'low': low, 'high': high}
            for name, (value, low, high) in fault.parameters.items()
        },
        'probability': fault.probability,
        'alternatives': [],
    }


def _candidates(
    walked: Walked, named: list[tuple[Found, float]], faults: tuple[Fault, ...]
) -> list[dict[str, Any]]:
    """Return all that were weighed, best first, each cause and place once."""
    rows: dict[tuple[str, str], dict[str, Any]] = {}

    def add(weighed: Weighed, probability: float) -> None:
        proposal = weighed.proposal
        key = (proposal.cause, str(_place(proposal)))
        if key not in rows or rows[key]['probability'] < probability:
            rows[key] = {
                'cause': proposal.cause,
                'location': _place(proposal),
                'probability': probability,
            }

    for found, probability in named:
        for rival in found.rivals:
            share = rival.probability
            add(rival, probability if rival.proposal is found.proposal else share)
    for rival in walked.weighed:
        add(rival, rival.probability)
    for fault in faults:
        rows[fault.cause, str(fault.location)] = {
            'cause': fault.cause,
            'location': dict(fault.location),
            'probability': fault.probability,
        }
    ordered = sorted(rows.values(), key=lambda row: -row['probability'])
    return ordered[:MOST_CANDIDATES]
