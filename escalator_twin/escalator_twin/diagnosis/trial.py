"""Run the twin with what a search proposes, and fit the best of it together with the tolerances."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from math import inf

from escalator_twin.diagnosis.afar import Afar
from escalator_twin.diagnosis.closing import closes, KICK_LEFT, MOST_LEFT, WHOLE_LEFT
from escalator_twin.diagnosis.context import Beside, Context
from escalator_twin.diagnosis.drive import refine_drive
from escalator_twin.diagnosis.fairness import falls_of, is_fitted, shared
from escalator_twin.diagnosis.fitting import (
    approached,
    fitted_beside,
    fitted_near,
    is_astray,
    MOVES_RESONANCE,
    plain,
    unturned,
)
from escalator_twin.diagnosis.floor import PASSED
from escalator_twin.diagnosis.free import freed
from escalator_twin.diagnosis.frequencies import from_other_frequencies
from escalator_twin.diagnosis.from_afar import FIRST_STEPS, scanned, SCANS, tried_from_afar, Worth
from escalator_twin.diagnosis.lengths import from_far
from escalator_twin.diagnosis.loops import LOCAL
from escalator_twin.diagnosis.polish import WHOLE_STEPS
from escalator_twin.diagnosis.proposals import Proposal, same_place
from escalator_twin.diagnosis.refine import refine, Refined
from escalator_twin.diagnosis.scan import scored
from escalator_twin.diagnosis.settling import led_whole
from escalator_twin.diagnosis.sides import across, other_sides, weighed_by_passages
from escalator_twin.diagnosis.stage import Stage
from escalator_twin.diagnosis.tried import Tried
from escalator_twin.diagnosis.unexplained import excess_of, is_open
from escalator_twin.diagnosis.waves import best_wave_alone, DRIVE, locked, pairs

CLOSE = 0.8  # of the best gain, from which a second one is fitted with the tolerances as well
# Fall of chi squared from which what an effect does hangs on the tolerances by more than noise: a
# tenth of it is some standard deviations.
LARGE = 300.0
# Of what is left above a good machine's: a step with all tolerances run beside the effect that gains less
# is the last.
WORTH = 0.05


def try_all(
    context: Context,
    place: Beside,
    known: Sequence[Proposal],
    contenders: Sequence[Proposal],
    jobs: int,
    afar: Afar | None = None,
    worth: Worth | None = None,
) -> list[Tried]:
    """Refine contenders with the twin, then fit the best together with everything else.

    Parameters
    ----------
    context : Context
    place : Beside
        The machine with the known effects.
    known : sequence of Proposal
        Accepted effects, of machine and measurement.
    contenders : sequence of Proposal
        Of the machine.
    jobs : int
        Simulations at a time.
    afar : Afar, optional
        More of them, for the machine as described.
    worth : callable, optional
        Takes a proposal that was run and its gain: whether it is worth a fit with everything else.

    Returns
    -------
    tried : list of Tried
        Best first.
    """
    base, fitted = place.model, place.fitted
    stage = place.stage.lean(base)
    single, moving = _runs_alone(contenders, known, afar is not None)
    with ThreadPoolExecutor(max(1, jobs)) as pool:
        refined = _refined(place, stage, contenders, single, pool, jobs)
        close = [r for r in refined if r.gain > CLOSE * refined[0].gain]
        leading = _first_of_places(best_wave_alone(close))[:2]
        leading = [r for r in leading if worth is None or worth(r.proposal, r.gain)]
        early: list[Tried] = []
        if afar is not None and _leads_from_afar(afar, stage, leading, pool):
            early = tried_from_afar(context, afar, place, known, (), moving, jobs, worth)
            leading = [] if any(closes(t, context.floor) for t in early) else leading
        fitted_again = early + _fitted_all(context, place, known, leading, jobs)

        def gain_of(proposal: Proposal) -> float:
            return max((p.gain for p in scored(stage, base, fitted, [proposal])), default=0.0)

        fitted_again += other_sides(place, known, refined, fitted_again, jobs, gain_of)
        if afar is not None:
            if not early:
                fitted_again += tried_from_afar(
                    context, afar, place, known, fitted_again, moving, jobs, worth
                )
            best = max((t.gain for t in fitted_again), default=0.0)
            # what is small beside the tolerances shows beside the tuned ones alone
            unseen = [p for p in moving if CLOSE * p.gain > best]
            fitted_again += [_fitted_here(context, place, known, p, jobs, worth) for p in unseen]
    rest = [
        replace(plain(r), falls=falls_of(place, stage, r.fitted))
        for r in refined
        if all(r is not one for one in leading) and not is_fitted(r.proposal, fitted_again)
    ]
    weighed = weighed_by_passages(fitted_again)
    tried = shared(place, locked(context, place, weighed + rest, jobs))
    tried.sort(key=lambda t: -t.gain)
    tried = _locked_better(known, tried, jobs)
    for farther in (from_far, from_other_frequencies):
        tried[:1] = [farther(context, place, known, t, jobs) for t in tried[:1]]
    settled = [_settled(place, known, t, jobs) if k == 0 else t for k, t in enumerate(tried)]
    if settled[:1] == tried[:1] or settled[0].proposal.cause not in DRIVE:
        return settled
    # what else was off had been taken for either lock's: by 12 of chi squared that were 2 once it was fitted
    again = sorted(locked(context, place, settled, jobs), key=lambda t: -t.gain)
    return _locked_better(known, again, jobs)


def _runs_alone(
    contenders: Sequence[Proposal], known: Sequence[Proposal], is_afar: bool
) -> tuple[list[Proposal], list[Proposal]]:
    """Return what is run by itself, and of it what is to be looked for with the machine as described."""
    single = [p for p in contenders if p.cause not in DRIVE]
    single += across(single, known)
    if not is_afar:
        return single, []
    # beside tolerances that were tuned to them they look like others
    moves = SCANS.keys() & MOVES_RESONANCE
    moving = [p for p in single if p.cause in moves]
    return [p for p in single if p.cause not in moves], moving[:1]


def _refined(
    place: Beside,
    stage: Stage,
    contenders: Sequence[Proposal],
    single: Sequence[Proposal],
    pool: ThreadPoolExecutor,
    jobs: int,
) -> list[Refined]:
    """Return contenders run with the twin and refined by a step, best first: single ones, and pairs of waves."""
    base, fitted = place.model, place.fitted
    alone = [p for p in single if p.cause not in SCANS]
    for cause, scan in SCANS.items():
        own = [p for p in single if p.cause == cause]
        alone += [scan(stage, base, fitted, p, jobs) for p in own[:1]]
    first = pool.map(lambda p: refine(stage, base, fitted, p, FIRST_STEPS), alone)
    waves = pool.map(
        lambda pair: refine_drive(stage, base, fitted, pair[0], pair[1], jobs),
        pairs(contenders, stage.observation.frame),
    )
    refined = [r for r in first if r is not None] + [r for pair in waves for r in pair]
    return sorted(refined, key=lambda r: -r.gain)


def _leads_from_afar(
    afar: Afar,
    stage: Stage,
    leading: Sequence[Refined],
    pool: ThreadPoolExecutor,
) -> bool:
    """Tell whether what is sought from afar leaves less, run once, than the rail's steps that lead here.

    Before a tolerance is tuned to it. A step's fit takes longest, and the machine's other effects leave some of it
    wherever rollers change tracks: beside a preload that closed all three of them took half of a search (seed 9013).
    """
    if not leading or any(r.proposal.cause not in PASSED for r in leading):
        return False
    here = min(stage.judged(r.fitted) for r in leading)
    base = afar.place

    def left_by(one: Proposal) -> float:
        run = refine(base.stage, base.model, base.fitted, one, FIRST_STEPS)
        return inf if run is None else base.stage.judged(base.fitted, one.cause) - run.gain

    return min(pool.map(left_by, afar.proposals), default=inf) < here


def _locked_better(known: Sequence[Proposal], tried: list[Tried], jobs: int) -> list[Tried]:
    """Fit the best with all else, where it is a wave that was fitted so with the other lock alone."""
    if not tried or tried[0].polished is not None or tried[0].proposal.cause not in DRIVE:
        return tried
    near = next((t.polished for t in tried if t.polished and t.proposal.cause in DRIVE), None)
    return tried if near is None else [fitted_near(known, tried[0], near, jobs), *tried[1:]]


def _first_of_places(refined: Sequence[Refined]) -> list[Refined]:
    """Return refined causes, of several rail's steps on one side of one place the best.

    Two hollows of a wrong place a pitch away would leave no room for the right one.
    """
    kept: list[Refined] = []
    for one in refined:
        is_step = one.proposal.cause in PASSED
        if not (is_step and any(same_place(one.proposal, other.proposal) for other in kept)):
            kept.append(one)
    return kept


def _fitted_all(
    context: Context,
    place: Beside,
    known: Sequence[Proposal],
    leading: Sequence[Refined],
    jobs: int,
) -> list[Tried]:
    """Fit the leading causes, each from tolerances of its own.

    Where all are of one link, axle or step, which hardly move the tolerances, they begin where these
    fit beside the first; where these had gone astray for want of it, from there or from none, as it fits the first.
    """
    turned, fitted = None, list[Tried]()
    if leading and all(r.proposal.cause in LOCAL - set(DRIVE) for r in leading):
        context, turned = approached(context, place, known, leading[0], jobs)
        if turned is not None and is_astray(place.stage):
            starts = [(context, turned), unturned(context, place, known, leading[0], jobs)]
            both = [
                fitted_beside(near, place, known, leading[0], begin, jobs)
                for near, begin in starts
            ]
            best = max((0, 1), key=lambda k: both[k].gain)
            (context, turned), fitted = starts[best], [both[best]]
    # each with all jobs: one may end long before the other
    with ThreadPoolExecutor(max(1, jobs)) as pool:
        rest = pool.map(
            lambda r: fitted_beside(context, place, known, r, turned, jobs),
            leading[len(fitted) :],
        )
        return [*fitted, *rest]


def _fitted_here(
    context: Context,
    place: Beside,
    known: Sequence[Proposal],
    proposal: Proposal,
    jobs: int,
    worth: Worth | None,
) -> Tried:
    """Look for a proposal's frequency beside the tolerances as they were tuned, and fit it from there."""
    stage = place.stage.lean(place.model)
    found = scanned(place, proposal, jobs)
    refined = refine(stage, place.model, place.fitted, found, FIRST_STEPS)
    if refined is None:
        return Tried(found, 0.0, {})
    if worth is not None and not worth(refined.proposal, refined.gain):
        return plain(refined)
    return fitted_beside(context, place, known, refined, jobs=jobs)


def _settled(place: Beside, known: Sequence[Proposal], tried: Tried, jobs: int) -> Tried:
    """Fit the best on, where its numbers hang on what the tolerances do beside it.

    Where no more is left than a good machine leaves, there is nothing to fit.
    """
    polished, cause = tried.polished, tried.proposal.cause
    if polished is None or cause not in LOCAL or tried.gain < LARGE:
        return tried
    floor = polished.context.floor
    if not is_open(polished.place, floor):
        return tried
    above, left = excess_of(place, floor), excess_of(polished.place, floor)
    worth = WORTH * left

    def goes_on(there: Beside, turn: int) -> bool:
        if turn and left >= MOST_LEFT * above:  # of what explains little, no turn makes more
            return False
        return excess_of(there, floor) >= (KICK_LEFT if turn else WHOLE_LEFT) * above

    whole = led_whole(
        polished, lambda beside: freed(beside, known), jobs, worth, worth, goes_on, WHOLE_STEPS
    )
    before = place.stage.judged(place.fitted, cause)
    gain = before - whole.place.stage.judged(whole.place.fitted, cause)
    if gain <= tried.gain:
        return tried
    return Tried(whole.effects[-1], gain, whole.sd[-1], whole)
