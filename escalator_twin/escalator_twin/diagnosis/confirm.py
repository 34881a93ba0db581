"""One more recording of a machine beside effects that other recordings have named.

Nothing of the effects is fitted to it before it is judged: it is the held-out proof of the others'
numbers, and then says what its own would be.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from escalator_twin.comparison.document import recording_document
from escalator_twin.comparison.judge import judge
from escalator_twin.comparison.locate import locate
from escalator_twin.diagnosis.context import (
    Beside,
    beside,
    Context,
    quiet_chi2,
    with_own_tolerances,
)
from escalator_twin.diagnosis.drive import refine_wave
from escalator_twin.diagnosis.faults import Fault, faults_of
from escalator_twin.diagnosis.fitting import MOVES_RESONANCE
from escalator_twin.diagnosis.floor_file import load_floor
from escalator_twin.diagnosis.free import any_local, freed, of_machine
from escalator_twin.diagnosis.heldout import hold_out
from escalator_twin.diagnosis.joint import Free
from escalator_twin.diagnosis.phases import rolled_here, with_phase
from escalator_twin.diagnosis.polish import increments, polish, polish_whole, Polished
from escalator_twin.diagnosis.preparation import prepare_tolerances
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.refine import Refined
from escalator_twin.diagnosis.scores import HeldOut
from escalator_twin.diagnosis.search import Search
from escalator_twin.diagnosis.search_gauges import gains
from escalator_twin.diagnosis.settling import (
    led_whole,
    MOST_STEPS,
    owned,
    settled,
    WORTH_A_STEP,
)
from escalator_twin.diagnosis.speeds import Rolled, rolled
from escalator_twin.diagnosis.split import split
from escalator_twin.diagnosis.stage import run_beside
from escalator_twin.diagnosis.tuning import tuned
from escalator_twin.diagnosis.unexplained import holds_more, is_open, look, NOT_JUDGED, Unexplained
from escalator_twin.diagnosis.view import View
from escalator_twin.diagnosis.waves import DRIVE
from escalator_twin.machine import Machine
from escalator_twin.signals import Recording
from escalator_twin.threads import one_thread_each

# Of a fit from other recordings' tolerances, with effects of single links in the runs; a turn far off was made there.
LOCAL_STEPS = 3


@dataclass(frozen=True)
class Confirmed:
    """What a recording says of effects that others have named.

    Attributes
    ----------
    document : mapping
        The recording's part of the comparison, before extension.
    effects : tuple of Proposal
        As this recording alone would have them, in the order that was asked for.
    sd : tuple of mapping of parameter to float
    unexplained : Unexplained
    held_out : HeldOut
        Gain with the others' sizes.
    faults : tuple of Fault
    residual : mapping
        What is left without and with the effects, by channel, see `split`.
    rolled : Rolled or None
        What the recording says of its rollers.
    is_open : bool
        Beside the effects more than a good machine's is left, or hidden in a tolerance: what a search looks for.
    """

    document: dict[str, Any]
    effects: tuple[Proposal, ...]
    sd: tuple[dict[str, float], ...]
    unexplained: Unexplained
    held_out: HeldOut
    faults: tuple[Fault, ...]
    residual: dict[str, Any]
    rolled: Rolled | None = None
    is_open: bool = False


@one_thread_each
def confirm_recording(
    recording: Recording,
    machine: Machine,
    effects: Sequence[Proposal],
    seed: int = 0,
    shared: Mapping[str, float] | None = None,
) -> Confirmed:
    """Put effects beside another recording.

    Parameters
    ----------
    recording : Recording
    machine : Machine
        As described.
    effects : sequence of Proposal
        Of machine and measurement, with the numbers that other recordings gave.
    seed : int
        Of the bootstrap.
    shared : mapping of tolerance to float, optional
        Standard deviations by which other recordings have the machine's turned beside the effects.
    """
    setting = locate(recording, machine)
    judgement = judge(setting, run_beside(machine, setting.experiment, setting), machine)
    document = recording_document(recording, setting, judgement, machine)
    if not setting.is_certain:
        return _unplaced(document, effects, tuple(faults_of(setting, machine)))
    context = prepare_tolerances(recording, machine, load_floor(machine), setting=setting)
    start = beside(context, steps=0)
    plain_context, before = tuned(context, start=start)
    waves = {k: _wave(before, e) for k, e in enumerate(effects) if e.cause in DRIVE}
    here = [
        with_phase(e, waves[k].proposal.parameters['phase_rad'])
        if k in waves
        else rolled_here(before, e)
        for k, e in enumerate(effects)
    ]
    own = [e for e in here if of_machine(e)]
    others = [e for e in here if not of_machine(e)]

    def free(place: Beside) -> Beside:
        return freed(place, others)

    near = _beside_shared(context, own, shared, free) if own and shared else None
    if near is not None and _fits(near, own, before):
        found = near
    else:
        tolerant, after = plain_context, before
        if own:
            tolerant, after = _by_itself(context, own, plain_context, before)
        is_nearer = near is not None and quiet_chi2(near.place) < quiet_chi2(after)
        found = near if near and is_nearer else settled(tolerant, after, own, free)
        found = led_whole(found, free)
    context, after = found.context, found.place
    again = iter(found.effects)
    here = [replace(e, parameters=next(again).parameters) if of_machine(e) else e for e in here]
    held = hold_out(context, after, here, seed, before.stage.turned, sizes_known=True)
    told: dict[int, tuple[Proposal, dict[str, float]]] = {
        k: (wave.proposal, dict(wave.sd)) for k, wave in waves.items()
    }
    rest = [k for k, e in enumerate(here) if of_machine(e) and k not in told]
    if rest:
        chosen = [here[k] for k in rest]
        known = tuple(here[k].deviation for k in waves)
        alone_here = increments(context, after, chosen, known)
        told |= dict(zip(rest, zip(*alone_here, strict=True), strict=True))
    if others:
        alone = tuple(e.deviation for e in here if of_machine(e))
        bound = beside(context, alone, steps=0, turned=after.stage.turned)
        told |= {k: _measured(context, bound, e) for k, e in enumerate(here) if k not in told}
    return Confirmed(
        document,
        tuple(told[k][0] for k in range(len(here))),
        tuple(told[k][1] for k in range(len(here))),
        look(context, before, after),
        held,
        tuple(faults_of(context.setting, machine)),
        {'before': split(context, before), 'after': split(context, after)},
        rolled(after, [told[k] for k in range(len(here))]),
        holds_more(after, context.floor, [str(e.nuisance) for e in here]),
    )


def _unplaced(
    document: dict[str, Any], effects: Sequence[Proposal], faults: tuple[Fault, ...]
) -> Confirmed:
    """Return what a recording says whose place in the loop is not certain: nothing of the effects' sizes."""
    held = HeldOut('its place in the loop is not certain', 0, None)
    unknown = tuple(dict[str, float]() for _ in effects)
    return Confirmed(document, tuple(effects), unknown, NOT_JUDGED, held, faults, {})


def _beside_shared(
    context: Context, effects: Sequence[Proposal], shared: Mapping[str, float], free: Free
) -> Polished:
    """Return the machine with effects, its tolerances fitted from where other recordings have them.

    What of treads is each recording's own is fitted with them. Beside effects of single links what tolerances do is
    run with these: what it is without them leads elsewhere.
    """
    deviations = tuple(e.deviation for e in effects)
    near = with_own_tolerances(context, deviations, turned=shared)
    if not any_local(effects):
        return polish(near, owned(effects), shared, free, steps=MOST_STEPS, is_near=True)
    place = polish(near, owned(effects), shared, free, steps=0, is_near=True)
    return polish_whole(place, free, worth=WORTH_A_STEP, steps=LOCAL_STEPS)


def _fits(near: Polished, effects: Sequence[Proposal], before: Beside) -> bool:
    """Tell whether a recording needs no other tolerances than those that others have led to.

    Beside effects of single links, whose runs take long, it is enough that it fits better than without effects.
    """
    if not is_open(near.place, near.context.floor):
        return True
    return any_local(effects) and quiet_chi2(near.place) < quiet_chi2(before)


def _by_itself(
    context: Context, effects: Sequence[Proposal], plain_context: Context, before: Beside
) -> tuple[Context, Beside]:
    """Return the machine with effects, its tolerances tuned: from none where effects move resonances.

    Else from where they were ``before`` the effects, and by what they did there.
    """
    deviations = tuple(e.deviation for e in effects)
    stood_for = {str(e.nuisance) for e in effects if e.nuisance}
    turned = {k: z for k, z in before.stage.turned.items() if k not in stood_for}
    if any(e.cause in MOVES_RESONANCE for e in effects):
        turned, plain_context = {}, with_own_tolerances(context, deviations)
    return tuned(plain_context, deviations, turned=turned, held=stood_for)


def _wave(place: Beside, effect: Proposal) -> Refined:
    """Return a wave of the drive as this recording alone would have it."""
    in_time = effect.cause == 'drive_hunting'
    return refine_wave(place.stage, place.model, place.fitted, effect, in_time)


def _measured(
    context: Context, place: Beside, effect: Proposal
) -> tuple[Proposal, dict[str, float]]:
    """Return an effect of the measurement as this recording alone would have it."""
    direction = context.setting.experiment.direction
    view = View.of(context.machine, place.stage.observation, context.responses, direction)
    for found in gains(Search(view, place.fitted, place.stage, place.model, 1)):
        if found.cause == effect.cause and found.location == effect.location:
            return found, dict(found.sd)
    return effect, {}
