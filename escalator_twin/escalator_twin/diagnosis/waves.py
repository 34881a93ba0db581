"""A wave of the drive's speed among the contenders: aligned anew, and locked to time or to travel."""

from collections.abc import Sequence
from dataclasses import replace
from math import isclose

import numpy as np

from escalator_twin.diagnosis.context import Beside, beside, Context
from escalator_twin.diagnosis.drive import locks, refine_wave
from escalator_twin.diagnosis.free import FREED
from escalator_twin.diagnosis.loops import Frame
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.refine import Refined
from escalator_twin.diagnosis.tried import Tried
from escalator_twin.errors import EscalatorError
from escalator_twin.machine import Deviation

CLOSE = 0.8  # of the best gain, from which the two locks are weighed
DRIVE = ('drive_hunting', 'drive_ripple')
IN_TIME = ('drive_hunting',)


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
    in_time = refined.proposal.cause in IN_TIME
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
    """Weigh hunting against ripple of one wave by the same runs."""
    waves = {cause: next((t for t in tried if t.proposal.cause == cause), None) for cause in DRIVE}
    hunting, ripple = waves['drive_hunting'], waves['drive_ripple']
    if hunting is None or ripple is None:
        return tried
    best = max(hunting.gain, ripple.gain)
    if best < CLOSE * max(t.gain for t in tried):
        return tried
    deviations = (*_known(context, place), hunting.proposal.deviation)
    anew = beside(context, deviations, steps=1, turned=place.stage.turned)
    bare = replace(anew.stage, machine=place.stage.machine)
    in_time, in_travel = locks(bare, bare.run(), hunting.proposal, jobs)
    weighed = {
        id(hunting): replace(hunting, gain=best - in_time),
        id(ripple): replace(ripple, gain=best - in_travel),
    }
    return [weighed.get(id(t), t) for t in tried]


def pairs(contenders: Sequence[Proposal], frame: Frame) -> list[tuple[Proposal, Proposal]]:
    """Return hunting and ripple of one frequency together."""
    pitch_s = frame.pitch_m / frame.speed_m_s
    hunting = [p for p in contenders if p.cause == 'drive_hunting']
    ripple = [p for p in contenders if p.cause == 'drive_ripple']
    return [
        (h, r)
        for h in hunting
        for r in ripple
        if isclose(h.parameters['frequency_hz'] * pitch_s, r.parameters['cycles_per_pitch'])
    ]
