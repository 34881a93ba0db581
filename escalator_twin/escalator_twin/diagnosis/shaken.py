"""How far the twin's law may be off where a step is shaken as it passes a place: carried as noise.

What a bump of the rail does to a step's x and z is hundreds of times these sensors' noise, and rollers leave
their track by it. Of one machine the twin and another program differ there by a tenth of all that, and by
half where rollers rattle in any case (`docs/diagnosis_constants.md`): far above the noise, which would have another
height, or another side, explain it better than the truth.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from scipy import ndimage

from escalator_twin.diagnosis.context import Beside, Context, SHAKEN, weighed_anew
from escalator_twin.diagnosis.floor import PASSED
from escalator_twin.diagnosis.free import freed
from escalator_twin.diagnosis.proposals import is_beside, Proposal
from escalator_twin.diagnosis.stage import Shaken, Stage
from escalator_twin.errors import EscalatorError
from escalator_twin.signals import Floats

LAW_SHARE = 0.2  # of the power of what a bump does there, by which the twin is off in shape
LAW_SCALE = 0.15  # of its strength, one standard deviation
NEXT_TO_NOTHING = (
    -0.02,
    -0.01,
    0.01,
    0.02,
)  # of its length: rattling rollers roll their dice anew
# Times the power of what changes so: dice that fall in one run and not in another say nothing of a bump,
# and taken at their own power they would speak against every bump, the more the higher it is.
DICE = 10.0
SMOOTH_S = 0.2  # over which power is averaged: a roller may land a little later or earlier


def carried(
    context: Context, place: Beside, effects: Sequence[Proposal], jobs: int = 1
) -> tuple[Context, Beside]:
    """Return a recording whose weights hold the law's error of effects that are passed, where these act.

    Parameters
    ----------
    context : Context
    place : Beside
        The machine without the effects.
    effects : sequence of Proposal
        Of any cause. Those at a place whose law's error is carried already change nothing.
    jobs : int
        Simulations at a time.
    """
    old = context.shaken
    done = list(old.effects if old is not None else ())
    new: list[Proposal] = []
    for effect in effects:
        if effect.cause in PASSED and not any(is_beside(effect, one) for one in done):
            new.append(effect)
            done.append(effect)
    stage = place.stage.lean(place.model)
    found = [f for f in (answer(stage, place.model, one, jobs) for one in new) if f is not None]
    if not found:
        return context, place
    index = place.stage.observation.index
    power = sum(power for _, power in found)
    weight = (1.0 / np.sqrt(1.0 + power)).astype(np.float32)
    columns = np.stack([column for column, _ in found], axis=2)
    if old is not None:
        was = old.at(index)
        weight, columns = weight * was.weight, np.concatenate([was.columns, columns], axis=2)
    context = replace(context, shaken=Shaken(index, weight, columns, tuple(done)))
    return context, freed(weighed_anew(context, place), place.freed)


def weighed_for(
    context: Context, place: Beside, effects: Sequence[Proposal], jobs: int = 1
) -> Callable[[Proposal], tuple[Context, Beside]]:
    """Return what gives each of some effects the recording beside the law's error of its own place.

    Effects at one place share what the first of them is off by: their weights must be the same.
    """
    rows: list[tuple[Proposal, tuple[Context, Beside]]] = []

    def known(effect: Proposal) -> tuple[Context, Beside] | None:
        return next((found for one, found in rows if is_beside(effect, one)), None)

    for effect in effects:
        if effect.cause in PASSED and known(effect) is None:
            rows.append((effect, carried(context, place, [effect], jobs)))

    def weighed(effect: Proposal) -> tuple[Context, Beside]:
        found = known(effect) if effect.cause in PASSED else None
        return found or (context, place)

    return weighed


def own_law(stage: Stage, effects: Sequence[Proposal]) -> np.ndarray:
    """Return which nuisance is how strong the twin has some effects: it is none without them, (q,) bool."""
    known = stage.shaken.effects if stage.shaken is not None else ()
    own = {
        f'{SHAKEN}{k}'
        for k, one in enumerate(known)
        if any(e.cause == one.cause and is_beside(e, one) for e in effects)
    }
    return np.array([name in own for name in stage.nuisance.names], bool)


def answer(
    stage: Stage, base: Floats, effect: Proposal, jobs: int = 1
) -> tuple[np.ndarray, Floats] | None:
    """Return a standard deviation of what an effect does to a step that it shakes, and what power it may be off by.

    Returns
    -------
    column : (n, c) float32
        SI.
    power : (n, c) float64
        Variance by place along travel, of which that of all else is 1.
    None where the machine cannot be run with it.
    """
    long = effect.parameters['length_m']
    near = [
        replace(effect, parameters={**effect.parameters, 'length_m': share * long})
        for share in (1.0, *(1.0 + by for by in NEXT_TO_NOTHING))
    ]
    try:
        with ThreadPoolExecutor(max(1, jobs)) as pool:
            change, *others = pool.map(lambda one: stage.run((one.deviation,)) - base, near)
    except EscalatorError:
        return None
    shaken = np.where(stage.quiet, 0.0, change)
    rate = stage.observation.frame.rate_hz

    def power_of(signals: Floats) -> Floats:
        along = stage.whiten.along(signals) ** 2
        smooth: Floats = ndimage.uniform_filter1d(along, round(SMOOTH_S * rate) | 1, axis=0)
        return smooth

    power = power_of(shaken)
    rolled = np.mean([power_of(np.where(stage.quiet, 0.0, o - change)) for o in others], axis=0)
    scale = (LAW_SCALE**2 + rolled.sum() / max(float(power.sum()), 1e-12)) ** 0.5
    return (scale * shaken).astype(np.float32), LAW_SHARE * power + DICE * rolled
