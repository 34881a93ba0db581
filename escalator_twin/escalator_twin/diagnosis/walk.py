"""The walk from a placed recording to its effects: search, simulate, weigh, accept, again."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from math import inf

from escalator_twin.diagnosis.accepted import found_of, left_of, match_of, placed_at, refitted
from escalator_twin.diagnosis.afar import at_the_edge, look_afar, may_hide, MOST_EDGES
from escalator_twin.diagnosis.bounds import Bounds
from escalator_twin.diagnosis.contenders import (
    ACCEPT,
    candidates,
    choose,
    is_hopeless,
    is_known_fault,
    is_unrun,
    one_gauge,
)
from escalator_twin.diagnosis.context import Beside, beside, Context, quiet_chi2
from escalator_twin.diagnosis.families import COSTLY, FAMILIES
from escalator_twin.diagnosis.fitting import fit_again, MOVES_RESONANCE
from escalator_twin.diagnosis.found import (
    Found,
    is_in_vain,
)
from escalator_twin.diagnosis.free import freed, of_machine
from escalator_twin.diagnosis.further import decide_between
from escalator_twin.diagnosis.hollows import out_of_hollow
from escalator_twin.diagnosis.neighbours import at_neighbours
from escalator_twin.diagnosis.once import told_once
from escalator_twin.diagnosis.polish import Polished
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.regroup import is_scattered, regrouped, unevenness
from escalator_twin.diagnosis.remnants import without_remnants
from escalator_twin.diagnosis.search import Search, search_all
from escalator_twin.diagnosis.suggested import begun, NOTHING, Suggested
from escalator_twin.diagnosis.trial import try_all
from escalator_twin.diagnosis.unexplained import (
    excess_of,
    explained_by,
    is_in_one_gauge,
    is_open,
    LEAST_EXPLAINED,
)
from escalator_twin.diagnosis.verdict import (
    by_data,
    EFFECT_TOLERANCES,
    size_in_tolerances,
    weigh,
    Weighed,
)
from escalator_twin.diagnosis.view import View
from escalator_twin.diagnosis.walked import Bench, Round, Walked

MOST_EFFECTS = 3
MOST_ROUNDS = 4  # one more, for what took a later effect's place and is dropped beside it

Say = Callable[[str], None]


def walk(
    context: Context,
    jobs: int = 1,
    start: Sequence[Proposal] = (),
    say: Say | None = None,
    bench: Bench | None = None,
    suggested: Suggested = NOTHING,
) -> Walked:
    """Find the effects in one recording.

    Parameters
    ----------
    context : Context
    jobs : int
        Simulations at a time.
    start : sequence of Proposal
        Effects that are known already.
    say : callable, optional
        Gets a line on each round.
    bench : Bench, optional
        Of the machine's kind; that of linked chains where it is not given.
    suggested : Suggested
        Fitted here before anything is sought.
    """
    bench = bench or LINKED
    found: list[Found] = []
    before = place = freed(context.place or beside(context), start)
    first = begun(bench.again, context, place, start, suggested, jobs)
    if first is not None:
        found = first[1]
        context, place = first[0].context, freed(first[0].place, start)
    weighed: list[Weighed] = []
    left: Found | None = None
    last: Round | None = None
    stages: list[Beside] = []
    anew: set[int] = set()  # how many effects were known where a round began once more
    done = accepted = 0
    while done < MOST_ROUNDS + len(anew):
        done += 1
        bounds = Bounds.of(before, place, context.floor, found, MOST_EFFECTS - 1 - len(found))
        is_left = bounds.is_open or bounds.is_hidden
        if len(found) == MOST_EFFECTS or (found and not is_left):
            break
        known = [*start, *(f.proposal for f in found)]
        proposals = [
            p for p in bench.propose(context, place, jobs) if not is_known_fault(p, known)
        ]
        lone = is_in_one_gauge(place, context.floor)
        if lone:  # what the machine does is in others too
            proposals = [p for p in proposals if not of_machine(p)]
        last = Round(context, place, tuple(known), tuple(proposals))
        afar = None
        hides_more = not lone and not bounds.is_left_over('', bounds.most())
        if hides_more and may_hide(place, context.floor, known):
            afar = look_afar(context, jobs, known)
        if afar is not None:
            edges = at_the_edge(afar.proposals, place)[:MOST_EDGES]
            afar = replace(afar, proposals=choose(afar.proposals), edges=edges)
        sought_all = [*proposals, *(afar.proposals if afar is not None else ())]
        if not any(bounds.may_stand(p) for p in sought_all):
            weighed = weigh(candidates(proposals, []))
            left = left_of(weighed, [])
            break
        chosen = [
            p for p in choose(proposals) if bounds.may_stand(p) and not is_hopeless(p, proposals)
        ]
        if afar is not None:
            sought = {p.cause for p in afar.proposals} & MOVES_RESONANCE
            chosen = [p for p in chosen if p.cause not in sought]
        rival = max((by_data(p, p.gain) for p in one_gauge(proposals)), default=-inf)
        worth = partial(bounds.is_worth_fitting, rival=rival)
        tried = bench.attempt(context, place, known, chosen, jobs, afar, worth)
        weighed = weigh(candidates(proposals, tried))
        if weighed and is_unrun(weighed[0], tried):
            # what was not chosen leads once those that were are no effects: nothing is named unrun
            alone = [weighed[0].proposal]
            tried = [
                *tried,
                *bench.attempt(context, place, known, alone, jobs, None, worth),
            ]
            weighed = weigh(candidates(proposals, tried))
            weighed = [w for w in weighed if not is_unrun(w, tried)]
        last = replace(last, tried=tuple(tried))
        if say is not None:
            for row in weighed[:4]:
                say(
                    f'{row.proposal.cause} {row.proposal.location} gain {row.gain:.1f} '
                    f'p {row.probability:.3f}'
                )
        if not weighed or weighed[0].probability < ACCEPT:
            break
        top = weighed[0]
        match = match_of(top, tried)
        if match is not None and bench.nearer is not None and len(found) not in anew:
            nearer = bench.nearer(context, place, known, match, jobs)
            if nearer is not None:  # once: the round begins anew beside it
                anew.add(len(found))
                context, place, found = nearer.context, nearer.place, refitted(found, nearer)
                before = before if known else place
                # what was weighed beside the other machine says nothing here
                weighed, last = list(found[-1].rivals) if found else [], None
                continue
        cause = top.proposal.cause
        if bounds.is_left_over(cause, top.gain):
            left = left_of(weighed, tried)
            break
        if of_machine(top.proposal) and bounds.is_in_vain(cause, top.gain):
            break
        last = None
        accepted += 1
        stages.append(place)
        found.append(found_of(weighed, match))
        polished = None if match is None else match.polished
        if polished is None:
            polished = bench.again(context, place, [*start, *(f.proposal for f in found)], jobs)
        context, place = polished.context, polished.place
        found = refitted(found, polished)
        once = told_once(found)
        if len(once) < len(found):
            polished = bench.again(context, place, [*start, *(f.proposal for f in once)], jobs)
            context, place = polished.context, polished.place
            found = refitted(once, polished)
            stages.pop()
        kept = without_remnants(found)
        if len(kept) < len(found):
            polished = bench.again(context, place, [*start, *(f.proposal for f in kept)], jobs)
            context, place = polished.context, polished.place
            found = refitted(kept, polished)
            if bench.neighbours is not None and is_open(place, context.floor):
                # it was chosen beside what turned out to be none
                known = [*start, *(f.proposal for f in found)]
                moved = bench.neighbours(bench.again, polished, known, jobs)
                if moved is not polished:
                    polished = moved
                    context, place = polished.context, polished.place
                    last_one = placed_at(found[-1], polished.effects[-1])
                    found = refitted([*found[:-1], last_one], polished)
        if bench.regroup is not None:
            other = _regrouped(bench.regroup, bench.again, polished, start, found, jobs)
            if other is not None:
                polished, found = other
                context, place = polished.context, polished.place
                stages.clear()  # they hold it where it was
        found = [f for f in found if not _is_gone(f.proposal)]
        effects = [f.proposal for f in found]
        place = freed(place, [*start, *effects])
        explained = explained_by(before, place, context.floor)
        if say is not None:
            say(f'{len(found)} effects explain {explained:.3f}')
        if is_in_vain(found, explained, MOST_EFFECTS - len(found), accepted):
            break
        if explained < LEAST_EXPLAINED and is_in_one_gauge(place, context.floor):
            break  # the strongest of what a gauge may have leaves nearly all of what it has
        if bench.is_scattered and bench.is_scattered(context, place, effects):
            break
    if len(stages) != len(found):
        stages = []
    return Walked(tuple(found), before, place, tuple(weighed), left, last, tuple(stages))


def _regrouped(
    regroup: Callable[[Context, Beside, Sequence[Proposal], int], list[Proposal] | None],
    again: Callable[[Context, Beside, Sequence[Proposal], int], Polished],
    polished: Polished,
    start: Sequence[Proposal],
    found: Sequence[Found],
    jobs: int,
) -> tuple[Polished, list[Found]] | None:
    """Return effects at other places that explain more together; None where there are none."""
    context, place = polished.context, polished.place
    effects = regroup(context, place, [*start, *(f.proposal for f in found)], jobs)
    if effects is None or effects[: len(start)] != list(start):
        return None
    other = again(context, place, effects, jobs)
    if quiet_chi2(other.place) >= quiet_chi2(place):
        return None
    rows = zip(found, effects[len(start) :], strict=True)
    return other, refitted([placed_at(one, effect) for one, effect in rows], other)


def _is_gone(proposal: Proposal) -> bool:
    """Tell whether nothing is left of an effect once a later one was fitted beside it."""
    return size_in_tolerances(proposal) < EFFECT_TOLERANCES


def propose(context: Context, place: Beside, jobs: int) -> list[Proposal]:
    """Return what all families of causes propose, best first."""
    view = View.of(
        context.machine,
        place.stage.observation,
        context.responses,
        context.setting.experiment.direction,
    )
    is_left = is_open(place, context.floor)
    stage = place.stage.lean(place.model)
    excess = sum(excess_of(place, context.floor, shaken) for shaken in (False, True))
    search = Search(view, place.fitted, stage, place.model, jobs, is_left, excess=excess)
    return search_all(search, FAMILIES, COSTLY)


def as_it_is(place: Beside, _: Sequence[Proposal]) -> Beside:
    """Return the comparison that effects are judged against: the machine within tolerance."""
    return place


def as_tuned(place: Beside, _: Sequence[Proposal]) -> Mapping[str, float]:
    """Return the tolerances as they were tuned."""
    return place.stage.turned


LINKED = Bench(
    propose,
    try_all,
    fit_again,
    as_it_is,
    decide_between,
    as_tuned,
    out_of_hollow,
    regrouped,
    at_neighbours,
    unevenness,
    is_scattered,
)
