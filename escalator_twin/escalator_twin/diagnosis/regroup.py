"""The steps of an accepted load: which of them still carry it beside what was found since, and whether alike."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from escalator_twin.diagnosis.context import Beside, Context
from escalator_twin.diagnosis.found import CLOSES
from escalator_twin.diagnosis.free import of_machine
from escalator_twin.diagnosis.joint import JointFit
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.regression import inner_products, inverse
from escalator_twin.diagnosis.search_places import LONGEST_RUN, worth_a_step
from escalator_twin.diagnosis.unexplained import excess_of, is_open, SIGMAS
from escalator_twin.diagnosis.verdict import neutral_of
from escalator_twin.diagnosis.view import View
from escalator_twin.errors import EscalatorError
from escalator_twin.signals import Floats

LOAD = 'load_distribution'
# Of what a load's one factor explains: where its steps with loads of their own would explain so much more, they do not
# carry one other load. Of three steps it was less than a hundred-thousandth, of loads that are uneven everywhere 0.06 to
# 0.09 (development).
UNEVEN_SHARE = 0.03


def regrouped(
    context: Context, place: Beside, effects: Sequence[Proposal], jobs: int = 1
) -> list[Proposal] | None:
    """Return effects with the steps of their loads that still carry them; None where all of them do.

    A load's steps are chosen one by one, by what each explains. Before a dragging roller was found, two steps on
    which it stood seemed loaded with three others: beside it they are worth less than none.

    Parameters
    ----------
    context : Context
    place : Beside
        The machine with all effects.
    effects : sequence of Proposal
        Of machine and measurement, in the order of their acceptance. The last one was chosen beside all others.
    jobs : int
        Simulations at a time.
    """
    chosen = [e for e in effects[:-1] if e.cause == LOAD and len(_steps(e)) > 1]
    kept = list(effects)
    for one, right, gram in _of_single_steps(context, place, chosen, effects, jobs):
        steps = carrying(right, gram, _steps(one))
        if len(steps) < len(_steps(one)):
            kept[kept.index(one)] = replace(one, location={**one.location, 'steps': steps})
    return None if kept == list(effects) else kept


def unevenness(
    context: Context, place: Beside, effects: Sequence[Proposal], jobs: int = 1
) -> dict[int, float]:
    """Return of every load on several steps what a load of each one's own would explain more, as a share.

    Where much is open beside it and loads of all steps would close it, those that were not chosen count as well.

    Parameters
    ----------
    context, place, effects, jobs
        As of `regrouped`.

    Returns
    -------
    dict of int to float
        By the load's number among ``effects``: of the fall of chi squared by their one factor, what
        noise gives taken off.
    """
    chosen = [e for e in effects if e.cause == LOAD and len(_steps(e)) > 1]
    found = {}
    for one, right, gram in _of_single_steps(context, place, chosen, effects, jobs):
        steps = _steps(one)
        rows = np.ix_(steps, steps)
        common = float(right[steps].sum() ** 2 / gram[rows].sum())
        free = float(right[steps] @ inverse(gram[rows]) @ right[steps]) - (len(steps) - 1)
        every = float(right @ inverse(gram) @ right) - (len(right) - 1)
        is_left = is_open(place, context.floor, SIGMAS)
        if is_left and every - common >= CLOSES * excess_of(place, context.floor):
            free = max(free, every)
        found[effects.index(one)] = (free - common) / common
    return found


def is_scattered(
    context: Context, place: Beside, effects: Sequence[Proposal], jobs: int = 1
) -> bool:
    """Tell whether a load is on more steps than are sought in a run, and on each of them another.

    Fewer may stand for what else is there, and are chosen once more beside it.

    Parameters
    ----------
    context, place, effects, jobs
        As of `regrouped`.
    """
    long = {k for k, e in enumerate(effects) if e.cause == LOAD and len(_steps(e)) > LONGEST_RUN}
    if not long:  # the twin need not run
        return False
    uneven = unevenness(context, place, effects, jobs)
    return any(uneven.get(k, 0.0) > UNEVEN_SHARE for k in long)


def _of_single_steps(
    context: Context,
    place: Beside,
    chosen: Sequence[Proposal],
    effects: Sequence[Proposal],
    jobs: int,
) -> Iterator[tuple[Proposal, Floats, Floats]]:
    """Yield some loads with the normal equations of every step's load beside all other effects."""
    responses = context.responses.places.get(LOAD) if chosen else None
    if responses is None:
        return
    direction = context.setting.experiment.direction
    view = View.of(context.machine, place.stage.observation, context.responses, direction)
    each = place.stage.columns(view.each(responses), LOAD)
    machine = [e for e in effects if of_machine(e)]
    for one in chosen:
        # what its numbers do is what its steps do
        fixed = [e if e is not one else replace(e, fitted=()) for e in machine]
        try:
            others = JointFit(context, (), None).columns(place, fixed, jobs)
        except EscalatorError:  # no machine runs beside these: the steps stay as they were chosen
            continue
        right, gram = _products(place, each, others)
        held = np.zeros(len(right))  # what the model holds of the load is put back
        held[_steps(one)] = one.parameters['load_factor'] - neutral_of(LOAD, 'load_factor')
        yield one, right + gram @ held, gram


def carrying(right: Floats, gram: Floats, steps: Sequence[int]) -> list[int]:
    """Return the steps of a load without those that pay for being chosen no more.

    Parameters
    ----------
    right : (n,) float64
        Right side of the normal equations of every step's load.
    gram : (n, n) float64
    steps : sequence of int
    """
    kept = list(steps)

    def gain(some: Sequence[int]) -> float:
        return float(right[some].sum() ** 2 / gram[np.ix_(some, some)].sum())

    while len(kept) > 1:
        options = [[s for s in kept if s != k] for k in kept]
        best = max(options, key=gain)
        if gain(best) < gain(kept) - worth_a_step(len(right)):
            break
        kept = best
    return kept


def _steps(effect: Proposal) -> list[int]:
    steps = effect.location['steps']
    assert isinstance(steps, list)
    return steps


def _products(place: Beside, each: np.ndarray, others: np.ndarray) -> tuple[Floats, Floats]:
    """Return the normal equations of single steps beside the numbers of other effects and the nuisance."""
    n = each.shape[1]
    right, gram = inner_products(place.fitted, np.concatenate([each, others], axis=1))
    cross = gram[:n, n:] @ inverse(gram[n:, n:])
    return right[:n] - cross @ right[n:], gram[:n, :n] - cross @ gram[n:, :n]
