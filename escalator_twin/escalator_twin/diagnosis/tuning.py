"""Tune a machine's tolerances to a recording, from long waves along the guide to short ones.

Tolerances of a landing or of the preload move rollers by millimetres along the guide. Waves of the
signals that are some centimetres long then fit as badly a little off as far off, and a search by
slopes stays where it begins; long waves lead it to where the short ones fit.
"""

from collections.abc import Callable, Collection, Mapping
from dataclasses import replace

import numpy as np

from escalator_twin.diagnosis.context import (
    Beside,
    beside,
    Context,
    quiet_chi2,
    with_own_tolerances,
)
from escalator_twin.diagnosis.loops import BAND_HZ
from escalator_twin.diagnosis.nuisance import make_nuisance
from escalator_twin.diagnosis.stage import Stage
from escalator_twin.diagnosis.whitening import frequencies
from escalator_twin.machine import Deviation

WAVES_PER_M = (16.0, 32.0, 56.0)  # up to which signals are compared, before all of the band
STEEPNESS = 8  # of that low-pass, as a power of frequency
MOST_STEPS = 2  # at each
STEP_SHARES = (1.0, 0.4)
SETTLED = 3.0  # chi squared: a step that gains less is the last one
NEAR = 1.0  # standard deviations over which a tolerance's effect is taken

Free = Callable[[Beside], Beside]


def coarse_to_fine(
    context: Context,
    place: Beside,
    deviations: tuple[Deviation, ...] = (),
    jobs: int = 1,
    held: Collection[str] = (),
    free: Free | None = None,
) -> dict[str, float]:
    """Return the tolerances, standard deviations, at which a machine comes nearest to a recording.

    Parameters
    ----------
    context : Context
    place : Beside
        The machine with the deviations, where the search begins. Its alignment is kept, and so is
        what effects of single links do to it.
    deviations : tuple of Deviation
    jobs : int
        Simulations at a time.
    held : collection of str
        Tolerances that are not turned.
    free : callable, optional
        Frees the nuisance that effects of the measurement stand for.
    """
    lean = place.stage.lean(place.model)
    turned = dict(lean.turned)
    speed = lean.observation.frame.speed_m_s
    cuts = [waves * speed for waves in WAVES_PER_M if waves * speed < BAND_HZ]
    for cut in [*cuts, None]:
        for _ in range(MOST_STEPS):
            near = with_own_tolerances(context, deviations, jobs, turned, NEAR, with_rails=False)
            at = _beside(near, place, replace(lean, turned=turned), held, free, cut)
            after = _step(at)
            if after is None:
                break
            turned = dict(after.stage.turned)
            if quiet_chi2(at) - quiet_chi2(after) < SETTLED:
                break
    return turned


def tuned(
    context: Context,
    deviations: tuple[Deviation, ...] = (),
    jobs: int = 1,
    turned: Mapping[str, float] | None = None,
    start: Beside | None = None,
) -> tuple[Context, Beside]:
    """Tune the tolerances of a machine, and take their effect where the tuning has led.

    Parameters
    ----------
    context : Context
    deviations : tuple of Deviation
    jobs : int
        Simulations at a time.
    turned : mapping of tolerance to float, optional
        Where the tuning begins, standard deviations.
    start : Beside, optional
        That machine with these tolerances, where it was aligned already.

    Returns
    -------
    context : Context
        Whose tolerances act as they do there.
    place : Beside
    """
    place = start or beside(context, deviations, steps=0, turned=turned)
    way = coarse_to_fine(context, place, deviations, jobs)
    near = with_own_tolerances(context, deviations, jobs, way)
    after = beside(near, deviations, steps=1, turned=way)
    return (near, after) if quiet_chi2(after) < quiet_chi2(place) else (context, place)


def _beside(
    context: Context,
    place: Beside,
    stage: Stage,
    held: Collection[str],
    free: Free | None,
    cut_hz: float | None,
) -> Beside:
    """Run a stage and fit its nuisance, up to a frequency; nothing is aligned anew."""
    model = stage.run()
    nuisance = make_nuisance(stage.observation, model, context.responses, stage.machine)
    columns = nuisance.columns.copy()
    columns[:, :, [name in held for name in nuisance.names]] = 0.0
    nuisance = replace(nuisance, columns=columns)
    whiten = stage.whiten
    if cut_hz is not None:
        rate = stage.observation.frame.rate_hz
        f = frequencies(len(stage.observation.index), rate)
        gain = 1.0 / (1.0 + (f / cut_hz) ** STEEPNESS)
        whiten = replace(whiten, weight=(whiten.weight.T * gain).T.astype(np.float32))
    stage = replace(stage, nuisance=nuisance, whiten=whiten, white_nuisance=whiten(columns))
    found = replace(place, stage=stage, model=model, fitted=stage.fit(model))
    return found if free is None else free(found)


def _step(place: Beside) -> Beside | None:
    """Turn the tolerances by a step, or by a part of it, that explains more; None without one."""
    before = quiet_chi2(place)
    for share in STEP_SHARES:
        stage = place.stage.tuned(place.fitted, share)
        model = stage.run()
        after = replace(place, stage=stage, model=model, fitted=stage.fit(model))
        if quiet_chi2(after) < before:
            return after
    return None
