"""Fits that begin at the machine as described, no tolerance turned."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from escalator_twin.causes.application import apply
from escalator_twin.diagnosis.afar import Afar
from escalator_twin.diagnosis.coarse import coarse_start
from escalator_twin.diagnosis.context import Beside, Context
from escalator_twin.diagnosis.exchanges import exchanges, Start
from escalator_twin.diagnosis.fitting import fitted_beside, of_machine_among
from escalator_twin.diagnosis.proposals import Proposal, same_place
from escalator_twin.diagnosis.reach import at_reference, reaches
from escalator_twin.diagnosis.refine import refine, Refined
from escalator_twin.diagnosis.tried import Tried
from escalator_twin.diagnosis.unexplained import excess_of
from escalator_twin.diagnosis.verdict import neutral_of, size_in_tolerances
from escalator_twin.errors import EscalatorError

# Tolerances of a size: two starts nearer than that are one. An argument, not measured: a fit's first step, which tunes
# all tolerances, leads farther; of one resistance by its slope and by a far change they were 0.01 to 0.02 apart.
ONE_START = 0.5

Begun = tuple[Sequence[Proposal], Refined]  # known effects, and the one that is fitted beside them


def fitted_afar(
    context: Context,
    afar: Afar,
    place: Beside,
    starts: Sequence[Begun],
    pool: ThreadPoolExecutor,
    jobs: int,
    places: Sequence[Beside],
) -> list[Tried]:
    """Fit causes from the machine as described, no tolerance turned.

    ``starts`` are known effects, each with the one that is fitted beside them. ``places`` are what others come
    down to: only what may come below the best of them is fitted to its end.
    """

    def fit(start: Begun) -> Tried:
        known, one = start
        level = least_of(one.proposal.cause, places)
        return fitted_beside(afar.context, place, known, one, {}, jobs, level)

    found = []
    for tried in pool.map(fit, starts):
        if tried.polished is not None:
            # from here on with what every other cause does
            knobs = tried.polished.context.responses.knobs
            whole = replace(context, responses=replace(context.responses, knobs=knobs))
            found.append(replace(tried, polished=replace(tried.polished, context=whole)))
    return found


def at_edges(
    context: Context,
    afar: Afar,
    place: Beside,
    known: Sequence[Proposal],
    tried: Sequence[Tried],
    pool: ThreadPoolExecutor,
    jobs: int,
) -> list[Tried]:
    """Fit the causes whose tolerance the tuning has used up, but those that were tried.

    Beside nothing known whatever is wrong may turn a tolerance to its edge: then only where
    nothing else closes what is open, or nothing is and more is hidden than good machines hide.
    """
    base, open_ = afar.place, excess_of(place, context.floor)
    done = {t.proposal.cause for t in tried if t.polished is not None}
    edges = [e for e in afar.edges if e.cause not in done]

    def run(edge: Proposal) -> Refined | None:
        whole = refine(base.stage, base.model, base.fitted, at_reference(edge), 0)
        if whole is None or not reaches(base, edge, whole.model, open_):
            return None
        return refine(base.stage, base.model, base.fitted, edge, 0)

    found = [r for r in pool.map(run, edges) if r is not None]
    begun = [(known, one) for one in found]
    return fitted_afar(context, afar, place, begun, pool, jobs, _ends(place, tried))


def sized(
    context: Context,
    afar: Afar,
    place: Beside,
    tried: Sequence[Tried],
    pool: ThreadPoolExecutor,
    jobs: int,
) -> list[Tried]:
    """Fit what leaves least of the long waves, beside nothing known, see `coarse`.

    Where a fit has ended near that size, nothing is gained by another.
    """
    base, start = afar.place, coarse_start(afar, pool)
    ended = [t.proposal for t in tried if t.polished is not None]
    if start is None or any(begin_alike(start, other) for other in ended):
        return []
    one = refine(base.stage, base.model, base.fitted, start, 0)
    begun: list[Begun] = [] if one is None else [((), one)]
    return fitted_afar(context, afar, place, begun, pool, jobs, _ends(place, tried))


def _ends(place: Beside, tried: Sequence[Tried]) -> list[Beside]:
    """Return the machines that a fit is to come below: where the tolerances are, and where others ended."""
    return [place, *(t.polished.place for t in tried if t.polished is not None)]


def exchanged(
    context: Context,
    afar: Afar,
    place: Beside,
    known: Sequence[Proposal],
    pool: ThreadPoolExecutor,
    jobs: int,
    places: Sequence[Beside],
) -> list[Tried]:
    """Fit what may have been told as more or less of a known effect, see `exchanges`."""
    base, open_ = afar.place, excess_of(place, context.floor)

    def run(start: Start) -> Begun | None:
        back, further = start
        machine = apply(context.machine, tuple(k.deviation for k in of_machine_among(back)))
        try:
            model = replace(base.stage, machine=machine).run((further.deviation,))
        except EscalatorError:  # such a machine does not run
            return None
        if not reaches(base, further, model, open_):
            return None
        none = np.empty((len(base.fitted.white), 0), np.float32)
        return back, Refined(further, model, base.fitted, 0.0, {}, none, ())

    starts = exchanges(context.machine, context.setting.experiment, known)
    begun = [start for start in pool.map(run, starts) if start is not None]
    return fitted_afar(context, afar, place, begun, pool, jobs, places)


def least_of(cause: str, places: Sequence[Beside]) -> float:
    """Return the least chi squared, of those that a cause is judged by, of several machines."""
    return min(p.stage.judged(p.fitted, cause) for p in places)


def way_of(one: Proposal) -> float:
    """Return which way a size is from neutral."""
    key = one.fitted[0]
    return one.parameters[key] - neutral_of(one.cause, key)


def begin_alike(one: Proposal, other: Proposal) -> bool:
    """Tell whether two of one cause at one place are nearly of one size."""
    if not same_place(one, other) or not one.fitted:
        return False
    is_one_way = way_of(one) * way_of(other) > 0.0
    return is_one_way and abs(size_in_tolerances(one) - size_in_tolerances(other)) < ONE_START
