"""Tune a machine's tolerances to a recording, from long waves along the guide to short ones.

Tolerances of a landing or of the preload move rollers by millimetres along the guide. Waves of the
signals that are some centimetres long then fit as badly a little off as far off, and a search by
slopes stays where it begins; long waves lead it to where the short ones fit. Resonances of carriage
and chain make more hollows: a tolerance at a time is turned far, to see whether a way down begins
there.
"""

from collections.abc import Collection, Mapping
from dataclasses import replace
from math import inf

import numpy as np

from escalator_twin.diagnosis.context import (
    Beside,
    beside,
    Context,
    quiet_chi2,
    with_own_tolerances,
)
from escalator_twin.diagnosis.descent import Descent, Free, KICKS, SLOW
from escalator_twin.diagnosis.grids import BAND_HZ
from escalator_twin.diagnosis.stage import Stage
from escalator_twin.machine import Deviation

CUTS_HZ = (4.0, 8.0, 14.0)  # up to which signals are compared, before all of the band
ROUNDS = len(KICKS)
# Of chi squared: where no turn of one tolerance promises that much, nothing is tuned on. Good machines of another make
# in a hollow promised 7 to 10 %, recordings of the prototype 1.5 % at most, with all
# that was wrong with them (development).
WORTH_AGAIN = 0.02
MOST_AGAIN = 3
# Of what effects of single links do, which is kept while tolerances are turned: as much as that is off by. A
# soft link's was 0.6 off (amplitude) where eight tolerances of one to two standard deviations were its machine's.
KEPT_OFF = 0.3


def coarse_to_fine(
    context: Context,
    place: Beside,
    deviations: tuple[Deviation, ...] = (),
    jobs: int = 1,
    held: Collection[str] = (),
    free: Free | None = None,
    rounds: int = ROUNDS,
    most: float = inf,
) -> tuple[dict[str, float], float]:
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
    rounds : int
        In which tolerances are turned far, to leave a hollow.
    most : float
        Chi squared: where slopes lead to more, none is turned far.

    Returns
    -------
    turned : mapping of tolerance to float
    level : float
        Chi squared there.
    """
    lean = _doubted(place.stage.lean(place.model))
    search = Descent(context, place, lean, deviations, jobs, held, free)
    turned: Mapping[str, float] = place.stage.turned
    fast = [knob.name for knob in place.stage.knobs if not knob.name.startswith(SLOW)]
    slow_alone = replace(search, held=(*held, *fast))
    for cut in CUTS_HZ:
        if cut < BAND_HZ:
            turned, _, _ = slow_alone.descend(turned, cut)
    turned, level, start = search.descend(turned)
    if level < most:
        turned, level = search.follow(turned, level, start, KICKS[:rounds])
    return dict(turned), level


def _doubted(lean: Stage) -> Stage:
    """Return a lean stage that weighs less where what is added to its runs may be off.

    Tolerances would be turned to make up for that.
    """
    if lean.added is None:
        return lean
    whiten = lean.whiten
    # Of a white sensor's variance, what is in the band.
    share = len(whiten.weight) / len(whiten.mask)
    with np.errstate(divide='ignore'):
        variance = share * np.mean(np.where(whiten.weight > 0.0, whiten.weight, np.inf) ** -2.0, 0)
    off = KEPT_OFF * lean.added / np.sqrt(variance)
    mask = whiten.mask / np.sqrt(1.0 + off**2)
    return replace(lean, whiten=replace(whiten, mask=mask.astype(np.float32)))


def tuned(
    context: Context,
    deviations: tuple[Deviation, ...] = (),
    jobs: int = 1,
    turned: Mapping[str, float] | None = None,
    start: Beside | None = None,
    held: Collection[str] = (),
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
    held : collection of str
        Tolerances that are not turned: deviations stand for them.

    Returns
    -------
    context : Context
        Whose tolerances act as they do there.
    place : Beside
    """
    place = start or beside(context, deviations, steps=0, turned=turned)
    way, _ = coarse_to_fine(context, place, deviations, jobs, held)
    near = with_own_tolerances(context, deviations, jobs, way)
    # one more step turns all of them
    after = beside(near, deviations, steps=0 if held else 1, turned=way)
    return (near, after) if quiet_chi2(after) < quiet_chi2(place) else (context, place)


def tuned_on(context: Context, place: Beside, jobs: int = 1) -> tuple[Context, Beside]:
    """Tune on beside what the rail does, and how the recording is aligned, where a tuning has led.

    Both are kept while tolerances are turned. Where a resonance of the chain is among the waves that are compared they
    are others there: of a machine whose chain swings at 18 Hz, 2200 of a chi squared of 10970
    (development).

    Parameters
    ----------
    context : Context
        Whose rail and tolerances act as they do at ``place``.
    place : Beside
        The machine within tolerance, tuned.
    jobs : int
        Simulations at a time.

    Returns
    -------
    context : Context
    place : Beside
        As given where no turn of one tolerance promises a good part of chi squared, or none holds it.
    """
    for _ in range(MOST_AGAIN):
        enough = (1.0 - WORTH_AGAIN) * quiet_chi2(place)
        search = Descent(context, place, place.stage.lean(place.model), (), jobs, (), None)
        start = search.at(place.stage.turned)
        kicked, there = search.kicked(start, KICKS[0])
        if there >= enough:
            break
        way, _ = search.follow(*search.descend(kicked), KICKS[1:])
        near = with_own_tolerances(context, (), jobs, way)
        after = beside(near, steps=1, turned=way)
        if quiet_chi2(after) >= enough:
            break
        context, place = near, after
    return context, place
