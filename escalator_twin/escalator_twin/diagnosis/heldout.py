"""What an extension gains on samples that its numbers were not fitted to."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
import re

import numpy as np

from escalator_twin.diagnosis.context import Beside, Context
from escalator_twin.diagnosis.floor import SHAKING
from escalator_twin.diagnosis.free import creep, known_of_measurement, of_machine, without_own
from escalator_twin.diagnosis.nuisance import CREEP
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.regression import fit, inner_products
from escalator_twin.diagnosis.scores import HeldOut, scored, Seen, undecided
from escalator_twin.diagnosis.stage import LARGEST, Stage
from escalator_twin.diagnosis.unexplained import limits_of, OPEN_SIGMAS
from escalator_twin.diagnosis.whitening import Whitener
from escalator_twin.machine import Machine
from escalator_twin.signals import Floats

BLOCKS = 12
FOLDS = 4
GUARD_PITCHES = 2
LEAST_SHARE = 0.25  # of a loop that must have come twice for an effect bound to one place
SLOW = re.compile(f'^course|/drift/|{CREEP}|/zero$')  # nuisance of the instruments, by name
BOUND = ('link', 'axle', 'step', 'steps', 's_m')  # keys of effects that pass once a loop


@dataclass(frozen=True)
class Earlier:
    """What was accepted before further effects.

    Attributes
    ----------
    machine : Machine
        With it.
    effects : tuple of Proposal
        Of machine and measurement.
    """

    machine: Machine
    effects: tuple[Proposal, ...]


def hold_out(
    context: Context,
    after: Beside,
    effects: Sequence[Proposal],
    seed: int = 0,
    turned: Mapping[str, float] | None = None,
    sizes_known: bool = False,
    earlier: Earlier | None = None,
) -> HeldOut:
    """Fit on a part of a recording, compare on the rest.

    The sizes of all effects together and all nuisance are fitted to the training blocks alone;
    which cause it is, and its place, were found with the whole recording.

    Parameters
    ----------
    context : Context
    after : Beside
        The machine with the effects, aligned.
    effects : sequence of Proposal
    seed : int
        Of the bootstrap.
    turned : mapping of tolerance to float, optional
        Where the machine comes nearest without the effects, standard deviations: what they gain is
        counted from there.
    sizes_known : bool
        The sizes come from other recordings: nothing of the effects is fitted to this one.
    earlier : Earlier, optional
        What was accepted before, and is on both sides: asked is what ``effects`` gain beside it.
    """
    stage = _with_columns(after.stage)
    machine = context.machine
    if earlier is not None:
        machine = earlier.machine
        stage = without_own(stage, earlier.effects)
        stage = known_of_measurement(stage, earlier.effects)
    stage = without_own(stage, effects)
    bare = replace(stage, machine=machine)
    base = bare.run()
    plain = base if turned is None else replace(bare, turned=dict(turned)).run()
    change = after.model - base
    for effect in effects:
        if not of_machine(effect):
            change = change + measured_change(after.stage, after, effect)
    # a gauge's fault is bound to no place: it is there all the time
    bound = [] if sizes_known else [e for e in effects if of_machine(e)]
    folds, split = folds_of(stage, bound)
    if not folds:
        return HeldOut(split, 0, None)
    shaking = any(effect.cause in SHAKING for effect in effects)
    stood_for = tuple(e.nuisance for e in effects if e.nuisance and not of_machine(e))
    bounded = np.array([name.startswith(stood_for) for name in bare.nuisance.names], bool)
    slow = slow_of(bare, effects)
    seen = _seen(bare, plain, base, change, folds, sizes_known, bounded, slow)
    used = np.ones(len(bare.quiet), bool) if shaking else bare.quiet
    acted_on = np.any(change != 0.0, axis=0)
    limits = limits_of(after, context.floor, OPEN_SIGMAS)
    found = scored(bare, seen, split, seed, used, acted_on, change, limits)
    if len(folds) == 1 and not found.significant and not found.worse:
        why = undecided(bare, seen, change, used)
        if why is not None:
            return HeldOut(f'no second look: on later passages {why}', 0, None)
    return found


def _with_columns(stage: Stage) -> Stage:
    """Return the stage without the names of what was freed for an effect: it has no column here."""
    nuisance = stage.nuisance
    names = nuisance.names[: nuisance.columns.shape[2]]
    return replace(stage, nuisance=replace(nuisance, names=names))


def measured_change(stage: Stage, after: Beside, effect: Proposal) -> Floats:
    """Return what a fault of the measurement adds to the signals, (n, c)."""
    if effect.cause == 'gauge_drift':
        found: Floats = creep(stage, effect).astype(np.float64)
        return found
    sizes = after.fitted.sizes
    total = np.zeros(after.model.shape)
    for k, name in enumerate(stage.nuisance.names):
        if effect.nuisance is not None and name.startswith(effect.nuisance):
            plain = stage.whiten(stage.nuisance.columns[:, :, k : k + 1])[:, 0]
            now = stage.white_nuisance[:, k]
            width = float(np.linalg.norm(now) / max(float(np.linalg.norm(plain)), 1e-30))
            total += sizes[k] * width * stage.nuisance.columns[:, :, k]
    return total


def folds_of(stage: Stage, effects: Sequence[Proposal]) -> tuple[list[list[tuple[int, int]]], str]:
    """Return folds of held-out blocks (grid points) and a text on the split."""
    frame = stage.observation.frame
    n = len(stage.observation.index)
    guard = GUARD_PITCHES * frame.per_pitch
    if any(key in effect.location for effect in effects for key in BOUND):
        start = frame.n_loop + guard
        if n - start < LEAST_SHARE * frame.n_loop:
            return [], 'no second passage: less than a quarter of a loop was passed twice'
        size = max(frame.per_pitch, (n - start) // BLOCKS // frame.per_pitch * frame.per_pitch)
        blocks = [(a, min(a + size, n)) for a in range(start, n - size + 1, size)]
        return [blocks], 'later passages: fitted to the first loop, compared on what follows'
    size = n // BLOCKS // frame.per_pitch * frame.per_pitch
    if size < 2 * frame.per_pitch:
        return [], 'too short: fewer than two pitches a block'
    blocks = [(k * size, (k + 1) * size) for k in range(BLOCKS)]
    text = f'{BLOCKS} blocks of whole pitches in {FOLDS} folds, {GUARD_PITCHES} pitches of guard'
    return [blocks[k::FOLDS] for k in range(FOLDS)], text


def _seen(
    stage: Stage,
    plain: Floats,
    base: Floats,
    change: Floats,
    folds: list[list[tuple[int, int]]],
    sizes_known: bool,
    bounded: np.ndarray,
    slow: np.ndarray,
) -> list[Seen]:
    """Return every held-out block with what is left of the recording without and with effects.

    ``bounded`` tells which nuisance effects of the measurement stand for, ``slow`` which is settled
    anew on what is held out, (q,) each.
    """
    n = len(stage.observation.index)
    guard = GUARD_PITCHES * stage.observation.frame.per_pitch
    later = len(folds) == 1
    before, residual = stage.residual(plain), stage.residual(base)
    seen: list[Seen] = []
    for blocks in folds:
        keep = np.ones(n, bool)
        for start, end in blocks:
            keep[max(start - guard, 0) : end + guard] = False
        if later:
            keep[blocks[0][0] - guard :] = False
        whiten = _precise(stage, keep)
        columns = whiten(stage.nuisance.columns)
        alone = sizes_within(whiten(before[:, :, None])[:, 0], columns, bounded)
        white, one = whiten(residual[:, :, None])[:, 0], whiten(change[:, :, None])
        right, gram = inner_products(fit(white, columns), one)
        # of the wrong sign it is no gain, however well it fits
        size = 1.0 if sizes_known else max(float(right[0] / max(gram[0, 0], 1e-12)), 0.0)
        again = sizes_within(white - size * one[:, 0], columns, bounded)
        left = before - np.tensordot(stage.nuisance.columns, stage.allowed(alone), 1)
        better = residual - size * change
        better = better - np.tensordot(stage.nuisance.columns, stage.allowed(again), 1)
        left, better = (_eased(stage, blocks, rows, slow) for rows in (left, better))
        seen += [(slice(*block), left, better) for block in blocks]
    return seen


def _precise(stage: Stage, keep: np.ndarray) -> Whitener:
    """Return the whitener of some of the samples, (n,) bool, in double precision.

    Where columns of some 1e4 standard deviations are nearly alike, products in single precision are off by more
    than the prior's one. That is next to nothing on samples that were fitted; on others it was 4 % of chi squared.
    """
    return replace(stage.whiten, mask=stage.whiten.mask * keep[:, None].astype(np.float64))


def sizes_within(white: np.ndarray, columns: np.ndarray, bounded: np.ndarray) -> Floats:
    """Return sizes of the nuisance, those that are bounded no larger than a good instrument's, (q,).

    A gauge's gain hardly resists: thirty of its standard deviations would be fitted without an effect.
    """
    sizes = fit(white, columns).sizes
    beyond = bounded & (np.abs(sizes) > LARGEST)
    if beyond.any():
        sizes[beyond] = np.clip(sizes[beyond], -LARGEST, LARGEST)
        held = columns[:, beyond] @ sizes[beyond].astype(columns.dtype)
        sizes[~beyond] = fit(white - held, columns[:, ~beyond]).sizes
    return sizes


def slow_of(stage: Stage, effects: Sequence[Proposal]) -> np.ndarray:
    """Return which nuisance is settled anew on held-out blocks: the instruments', (q,) bool.

    Not that of a gauge that is said to creep, nor of a channel whose mean counts: it would take the
    claim's place on both sides.
    """
    creeping = {e.location.get('link') for e in effects if e.cause == 'gauge_drift'}
    own = tuple(
        f'{channel}/'
        for channel in stage.observation.channels
        if stage.machine.instruments.sensor(channel).name in creeping
        or channel in stage.told_by_mean
    )
    names = stage.nuisance.names
    return np.array([SLOW.search(n) is not None and not n.startswith(own) for n in names], bool)


def _eased(
    stage: Stage, blocks: Sequence[tuple[int, int]], residual: Floats, slow: np.ndarray
) -> Floats:
    """Return a residual with the instruments' slow nuisance fitted to the held-out blocks, (n, c).

    What gauges creep by, and where the chain is to a millimetre, is no part of a claim, and what other
    blocks say of it does not reach into these: drawn out, it would drown what is compared.
    """
    held = np.zeros(len(residual), bool)
    for block in blocks:
        held[slice(*block)] = True
    whiten = _precise(stage, held)
    columns = stage.nuisance.columns[:, :, slow]
    sizes = fit(whiten(residual[:, :, None])[:, 0], whiten(columns)).sizes
    eased: Floats = residual - np.tensordot(columns, sizes, 1)
    return eased
