"""Fit what was sought from the machine as described, beginning there."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

from escalator_twin.diagnosis.afar import Afar
from escalator_twin.diagnosis.begun_afar import (
    at_edges,
    begin_alike,
    exchanged,
    fitted_afar,
    least_of,
    sized,
    way_of,
)
from escalator_twin.diagnosis.closing import is_closed, is_done, is_hiding, is_local, is_riddle
from escalator_twin.diagnosis.context import Beside, Context
from escalator_twin.diagnosis.fitting import fitted_beside
from escalator_twin.diagnosis.frames import best_frame
from escalator_twin.diagnosis.free import of_machine
from escalator_twin.diagnosis.loops import LOCAL
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.refine import refine, Refined
from escalator_twin.diagnosis.stretches import best_stretch
from escalator_twin.diagnosis.tried import Tried
from escalator_twin.diagnosis.unexplained import beyond_tolerance

FIRST_STEPS = 1  # of a contender, before the best is known
FAR_ABOVE = 2.0  # times a chi squared: what fitting will not make up for
CLOSEST = 0.85  # the same of what was sought from afar
# Whose ends or frequency are looked for with the twin itself: the best of each.
SCANS = {'guide_drag': best_stretch, 'truss_resonance': best_frame}

Worth = Callable[[Proposal, float], bool]


def tried_from_afar(
    context: Context,
    afar: Afar,
    place: Beside,
    known: Sequence[Proposal],
    fitted: Sequence[Tried],
    moving: Sequence[Proposal],
    jobs: int,
    worth: Worth | None = None,
) -> list[Tried]:
    """Fit what may look like other causes beside tolerances that were tuned to it.

    Nothing is where one of those fitted closes the recording, or explains more than all else may.

    Parameters
    ----------
    context : Context
    afar : Afar
    place : Beside
        The machine with the known effects, its tolerances tuned.
    known : sequence of Proposal
        Accepted effects, of machine and measurement.
    fitted : sequence of Tried
        What was fitted from there.
    moving : sequence of Proposal
        More contenders, whose frequency is to be looked for with the machine as described.
    jobs : int
        Simulations at a time.
    worth : callable, optional
        As of `trial.try_all`.
    """
    floor = context.floor
    if is_closed(fitted, floor) or is_local(place, fitted, floor):
        return []
    proposals = [*afar.proposals, *(scanned(afar.place, p, jobs) for p in moving)]
    sought = replace(afar, proposals=proposals)
    places = [place, *(t.polished.place for t in fitted if t.polished is not None)]

    def is_worth(one: Proposal, gain: float) -> bool:
        left = not is_done(place, fitted, one, floor)
        return left and (worth is None or worth(one, gain))

    with ThreadPoolExecutor(max(1, jobs)) as pool:
        found = _tried_afar(context, sought, place, known, pool, jobs, places, is_worth)
        tried = [*fitted, *found]
        if known or is_riddle(place, tried, floor) or is_hiding(place, tried, floor):
            found += at_edges(context, afar, place, known, tried, pool, jobs)
        if not known and is_riddle(place, [*fitted, *found], floor):
            found += sized(context, afar, place, [*fitted, *found], pool, jobs)
        if is_riddle(place, [*fitted, *found], floor):
            found += exchanged(context, afar, place, known, pool, jobs, places)
    if all(t.gain <= 0.0 for t in [*fitted, *found] if t.polished is not None):
        found += _from_here(context, sought, place, known, jobs, is_worth)
    return found


def _from_here(
    context: Context,
    afar: Afar,
    place: Beside,
    known: Sequence[Proposal],
    jobs: int,
    worth: Worth,
) -> list[Tried]:
    """Fit what was sought from afar where the tolerances are, if they have its own farther than a good machine.

    From none turned no way may lead back to where they are. Beside a longer link a spring of 1.4 was sought from
    afar as 1.41, and its fit from there came to 1.4 times the chi squared of a machine whose spring was turned by
    eleven of its tolerances (seed 9002, development).
    """
    beyond = beyond_tolerance(place)
    stage = place.stage.lean(place.model)
    for one in afar.proposals:
        held = beyond.get(one.nuisance or '', 0.0)
        if not one.fitted or way_of(one) * held <= 0.0:
            continue
        refined = refine(stage, place.model, place.fitted, one, FIRST_STEPS)
        if refined is None or refined.gain <= 0.0 or not worth(refined.proposal, refined.gain):
            continue
        return [fitted_beside(context, place, known, refined, jobs=jobs)]
    return []


def scanned(place: Beside, proposal: Proposal, jobs: int) -> Proposal:
    """Return a proposal whose ends or frequency were looked for beside a machine."""
    stage = place.stage.lean(place.model)
    return SCANS[proposal.cause](stage, place.model, place.fitted, proposal, jobs)


def _tried_afar(
    context: Context,
    afar: Afar,
    place: Beside,
    known: Sequence[Proposal],
    pool: ThreadPoolExecutor,
    jobs: int,
    places: Sequence[Beside],
    worth: Worth | None = None,
) -> list[Tried]:
    """Fit what was sought from the machine as described, beginning there.

    ``places`` are what others come down to: what is far above the best of them is left. ``worth`` is that of
    `trial.try_all`.
    """
    base = afar.place

    def is_far(one: Refined) -> bool:
        cause = one.proposal.cause
        return base.stage.judged(base.fitted, cause) - one.gain >= FAR_ABOVE * least_of(
            cause, places
        )

    first = pool.map(
        lambda p: refine(base.stage, base.model, base.fitted, p, FIRST_STEPS), afar.proposals
    )
    refined = sorted((r for r in first if r is not None), key=lambda r: -r.gain)
    leading = _apart([r for r in refined if r.gain > CLOSEST * refined[0].gain])[:2]
    leading = [r for r in leading if worth is None or worth(r.proposal, r.gain)]
    # beside what changes the whole machine, what the tolerances are to take up is far above all else
    if not any(of_machine(k) and k.cause not in LOCAL for k in known):
        leading = [r for r in leading if not is_far(r)]
    return fitted_afar(context, afar, place, [(known, one) for one in leading], pool, jobs, places)


def _apart(refined: Sequence[Refined]) -> list[Refined]:
    """Return refined causes without those that would be fitted from where a better one is."""
    kept: list[Refined] = []
    for one in refined:
        if not any(begin_alike(one.proposal, other.proposal) for other in kept):
            kept.append(one)
    return kept
