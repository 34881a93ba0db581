"""A wave of the drive's speed among the contenders: aligned anew, and locked to time or to travel."""

from collections.abc import Sequence
from dataclasses import replace
from math import isclose, pi

import numpy as np

from escalator_twin.diagnosis.context import Beside, beside, Context
from escalator_twin.diagnosis.drive import agreed, locks, refine_wave, Told
from escalator_twin.diagnosis.free import FREED
from escalator_twin.diagnosis.grids import Frame
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.refine import Refined
from escalator_twin.diagnosis.tried import Tried
from escalator_twin.diagnosis.verdict import evidence_of
from escalator_twin.errors import EscalatorError
from escalator_twin.machine import Deviation

CLOSE = 0.8  # of the best gain, from which the two locks are weighed
DRIVE = HUNTING, RIPPLE = ('drive_hunting', 'drive_ripple')


def realigned(context: Context, place: Beside, refined: Refined, jobs: int = 1) -> Refined:
    """Align the recording anew with a wave of the drive, and fit it there once more."""
    deviations = (*_known(context, place), refined.proposal.deviation)
    try:
        anew = beside(context, deviations, turned=place.stage.turned)
    except EscalatorError:
        return refined
    bare = replace(anew.stage, machine=place.stage.machine)
    if bare.white_nuisance.shape[1] == place.stage.white_nuisance.shape[1]:
        bare = replace(bare, white_nuisance=bare.white_nuisance * _widths(place))
    in_time = refined.proposal.cause == HUNTING
    again = refine_wave(bare, bare.run(), place.fitted, refined.proposal, in_time, jobs)
    cause = refined.proposal.cause
    gain = place.stage.judged(place.fitted, cause) - bare.judged(again.fitted, cause)
    return replace(again, gain=gain) if gain > refined.gain else refined


def _known(context: Context, place: Beside) -> tuple[Deviation, ...]:
    """Return the deviations that were accepted so far."""
    return place.stage.machine.deviations[len(context.machine.deviations) :]


def _widths(place: Beside) -> np.ndarray:
    """Return by how much each nuisance's prior was widened, (q,)."""
    plain = place.stage.whiten(place.stage.nuisance.columns[:, :, :])
    now = place.stage.white_nuisance[:, : plain.shape[1]]
    power = np.sqrt(np.sum(now**2, axis=0) / np.maximum(np.sum(plain**2, axis=0), 1e-30))
    return np.where(power > 2.0, FREED, 1.0).astype(np.float32)


def locked(context: Context, place: Beside, tried: list[Tried], jobs: int = 1) -> list[Tried]:
    """Weigh hunting against ripple of one wave by the same runs, the recording aligned beside either.

    One of them was fitted together with the tolerances; where it is the other, that begins from there.
    """
    waves = {cause: next((t for t in tried if t.proposal.cause == cause), None) for cause in DRIVE}
    hunting, ripple = waves[HUNTING], waves[RIPPLE]
    if hunting is None or ripple is None:
        return tried
    first = max((hunting, ripple), key=lambda t: t.gain)
    if first.gain < CLOSE * max(t.gain for t in tried):
        return tried
    if evidence_of(first.proposal, first.gain) <= 0.0:  # what is no effect has no lock
        return tried
    frame, direction = place.stage.observation.frame, context.setting.experiment.direction
    in_time = as_locked(first.proposal, HUNTING, frame, direction)
    turned = place.stage.turned if first.polished is None else first.polished.place.stage.turned

    def told(wave: Proposal) -> Told:
        """Compare the locks in a recording that is aligned beside a wave of one of them."""
        deviations = (*_known(context, place), wave.deviation)
        anew = beside(context, deviations, steps=1, turned=turned)
        bare = replace(anew.stage, machine=place.stage.machine)
        return locks(bare, bare.run(), in_time, jobs)

    in_travel = as_locked(first.proposal, RIPPLE, frame, direction)
    better = agreed(told(in_time), told(in_travel))
    higher = {HUNTING: max(-better, 0.0), RIPPLE: max(better, 0.0)}

    def weighed(one: Tried) -> Tried:
        cause = one.proposal.cause
        gain = first.gain - higher[cause]
        if one is first:
            return replace(one, gain=gain)
        return Tried(as_locked(first.proposal, cause, frame, direction), gain, one.sd)

    return [weighed(t) if t is hunting or t is ripple else t for t in tried]


def as_locked(wave: Proposal, cause: str, frame: Frame, direction: int) -> Proposal:
    """Return a wave of the drive as one that is locked to time, or to travel, at an even speed.

    A ripple is a wave of the rack's travel, which falls where the machine runs down.
    """
    if wave.cause == cause:
        return wave
    numbers = dict(wave.parameters)
    pitch_s = frame.pitch_m / frame.speed_m_s
    if cause == RIPPLE:
        numbers['cycles_per_pitch'] = numbers.pop('frequency_hz') * pitch_s
    else:
        numbers['frequency_hz'] = numbers.pop('cycles_per_pitch') / pitch_s
    phase = numbers['phase_rad'] if direction > 0 else pi - numbers['phase_rad']
    numbers['phase_rad'] = (phase + pi) % (2.0 * pi) - pi
    names = {'frequency_hz': 'cycles_per_pitch', 'cycles_per_pitch': 'frequency_hz'}
    fitted = tuple(names.get(key, key) for key in wave.fitted)
    return replace(wave, cause=cause, parameters=numbers, fitted=fitted, sd={})


def best_wave_alone(refined: Sequence[Refined]) -> list[Refined]:
    """Return what was refined, of all waves of the drive the best alone.

    Locked to time or to travel it is much the same wave, and is fitted with all else once; which it is, `locked`
    weighs.
    """
    kept: list[Refined] = []
    for one in refined:
        if one.proposal.cause in DRIVE and any(k.proposal.cause in DRIVE for k in kept):
            continue
        kept.append(one)
    return kept


def pairs(contenders: Sequence[Proposal], frame: Frame) -> list[tuple[Proposal, Proposal]]:
    """Return hunting and ripple of one frequency together."""
    pitch_s = frame.pitch_m / frame.speed_m_s
    hunting = [p for p in contenders if p.cause == HUNTING]
    ripple = [p for p in contenders if p.cause == RIPPLE]
    return [
        (h, r)
        for h in hunting
        for r in ripple
        if isclose(h.parameters['frequency_hz'] * pitch_s, r.parameters['cycles_per_pitch'])
    ]
