"""Which of the effects that a walk found are named, with what gain, and what stays unexplained beside them."""

from collections.abc import Sequence
from math import inf

from escalator_twin.diagnosis.accepted import refitted
from escalator_twin.diagnosis.context import Beside, Context
from escalator_twin.diagnosis.found import Found, ONE_GAUGE
from escalator_twin.diagnosis.free import freed, of_machine
from escalator_twin.diagnosis.heldout import Earlier, hold_out
from escalator_twin.diagnosis.linked import LINKED
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.regroup import UNEVEN_SHARE
from escalator_twin.diagnosis.scores import HeldOut
from escalator_twin.diagnosis.spread import with_reach
from escalator_twin.diagnosis.unexplained import belief_beside, look, Unexplained
from escalator_twin.diagnosis.verdict import (
    FAR_SIZE,
    size_in_nearest,
    size_in_references,
    SLIGHT_SIZE,
)
from escalator_twin.diagnosis.walked import Bench, Walked
from escalator_twin.errors import EscalatorError
from escalator_twin.machine import Machine

NAMED = 0.5  # probability from which an effect is told as accepted
SMALL = 0.1  # of the largest effect's fall of chi squared
# Of the probability of such a one, where much stays unexplained, or of a size far out.
DOUBT = 0.45
# Of the loop: what brakes on more of it is no stretch's, and may be all rollers' at this speed. Grease eight times as
# thick was told as 13.6 N on all of the loop (seed 9011).
LONGEST_STRETCH = 0.6
REFUSED = 0.3  # of the probability, where nothing is gained held out or a channel becomes worse


def _has_other_gauges(machine: Machine) -> bool:
    """Tell whether what a law leaves would show in more gauges than one."""
    return sum(s.quantity == 'link_force' for s in machine.instruments.sensors) > 1


def _is_far_out(found: Found) -> bool:
    """Tell whether an effect of the machine is larger than its law is known to hold."""
    return of_machine(found.proposal) and size_in_references(found.proposal) > FAR_SIZE


def _is_slight(found: Found) -> bool:
    """Tell whether an effect of the machine is smaller than bars are told for.

    What is on no list and looks a little like a cause is fitted by a little of it, and leaves something open.
    """
    return of_machine(found.proposal) and size_in_nearest(found.proposal) < SLIGHT_SIZE


def _is_everywhere(context: Context, found: Found) -> bool:
    """Tell whether a stretch of drag is most of the loop."""
    place = found.proposal.location
    if found.proposal.cause != 'guide_drag':
        return False
    span = float(str(place['s_to_m'])) - float(str(place['s_from_m']))
    return span > LONGEST_STRETCH * abs(context.responses.base.length_m)


def conclude(
    context: Context, walked: Walked, rest: Unexplained, seed: int, bench: Bench, jobs: int = 1
) -> tuple[list[tuple[Found, float]], HeldOut | None, Unexplained, Beside]:
    """Decide which effects are named, and tell sizes, gain and remainder of these alone.

    Returns
    -------
    named : list of (Found, probability)
        Of all that were found.
    held : HeldOut or None
    rest : Unexplained
    after : Beside
        The machine with what is named; where nothing is, with what was found.
    """
    named, held = settle(context, walked, rest, seed, bench)
    after, count = walked.after, len(named)
    standing = with_named_alone(context, walked, named, bench, jobs)
    if standing is not None:
        named, after = standing
        count = sum(p >= NAMED for _, p in named)
        was = belief_in([found.proposal for found in walked.found], held, rest)
        effects = [found.proposal for found, _ in named[:count]]
        rest = look(context, bench.bare(walked.before, effects), after)
        held = hold_out(context, after, effects, seed, bench.begin(walked.before, effects))
        # beside the others more was explained: what is open now speaks against these alone
        doubt = min(belief_in(effects, held, rest) / was, 1.0)
        doubt *= REFUSED if is_refused(held) else 1.0
        named = [(found, doubt * p) for found, p in named]
    rest = left_open(context, walked, named, rest)
    if bench is LINKED and any(p >= NAMED for _, p in named):
        reached = with_reach(context, after, [found for found, _ in named[:count]], jobs)
        named[:count] = [(found, p) for found, (_, p) in zip(reached, named, strict=False)]
    return named, held, rest, after


def belief_in(effects: Sequence[Proposal], held: HeldOut | None, rest: Unexplained) -> float:
    """Return what is left of names' probability beside what stays open with them: the more of it, the less."""
    if not rest.significant:
        return 1.0
    explained = rest.explained
    of_instruments = not any(of_machine(effect) for effect in effects)
    if held is not None and held.significant and of_instruments:
        # an instrument's own nuisance takes its fault at a small price: beside a good instrument's, which is
        # what is held out without it, the fault explains more
        explained = max(explained, held.whole_low)
    return belief_beside(explained)


def is_refused(held: HeldOut) -> bool:
    """Tell whether a second look speaks against effects: nothing is gained, or a channel becomes worse."""
    return held.channels is not None and (bool(held.worse) or not held.significant)


def settle(
    context: Context, walked: Walked, rest: Unexplained, seed: int, bench: Bench = LINKED
) -> tuple[list[tuple[Found, float]], HeldOut | None]:
    """Decide which effects are named, by what they explain and by what they gain held out.

    Returns
    -------
    named : list of (Found, probability)
    held : HeldOut or None
    """
    if not walked.found:
        return [], None
    effects = [f.proposal for f in walked.found]
    start = bench.begin(walked.before, effects)
    held = hold_out(context, walked.after, effects, seed, start)
    factor = belief_in(effects, held, rest)
    if is_refused(held):
        factor *= REFUSED
    if held.channels is None:
        factor *= 0.95  # no second look
    largest = max(found.gain for found in walked.found)
    alone = ONE_GAUGE if _has_other_gauges(context.machine) else ()
    farthest = max((found.gain for found in walked.found if _is_far_out(found)), default=-inf)
    of_its_own = gained_beside(context, walked, seed, bench)
    uneven = bench.unevenness(context, walked.after, effects) if bench.unevenness else {}
    named = []
    for k, (found, gained) in enumerate(zip(walked.found, of_its_own, strict=True)):
        small = found.gain < SMALL * largest and found.proposal.cause not in alone
        # beside a larger remainder that nothing explains, a small further effect may be a part of it
        is_part = found.gain < rest.beside(found.proposal.cause)
        doubt = DOUBT if small and rest.significant and is_part else 1.0
        # nothing is left, but so far out something else may act like this law, or like it and what it leaves
        # beside it; a gauge's is exact
        if of_machine(found.proposal) and farthest >= found.gain:
            doubt *= DOUBT
        if not gained:
            doubt *= REFUSED
        if uneven.get(k, 0.0) > UNEVEN_SHARE or _is_everywhere(context, found):
            doubt *= DOUBT
        if rest.significant and _is_slight(found):
            doubt *= DOUBT
        named.append((found, found.probability * factor * doubt))
    return named, held


def gained_beside(
    context: Context, walked: Walked, seed: int, bench: Bench = LINKED
) -> list[bool]:
    """Tell of every effect whether held-out blocks leave it standing beside the others.

    What all gain together may be one's alone. A later fault of the measurement is on both sides as it stands;
    beside later effects of the machine tolerances would have to be fitted anew, and an effect is asked beside those
    before it. Of the first beside such, and of what has no second look, nothing is said.
    """
    effects = tuple(found.proposal for found in walked.found)
    if len(effects) < 2 or not walked.stages:
        return [True] * len(effects)
    gained = []
    for k, effect in enumerate(effects):
        known, after = (*effects[:k], *effects[k + 1 :]), walked.after
        if any(of_machine(later) for later in effects[k + 1 :]):
            known, after = effects[:k], walked.stages[k + 1]
        if not known:
            gained.append(True)
            continue
        before = walked.stages[k]
        earlier = Earlier(before.stage.machine, known)
        start = bench.begin(before, [effect])
        try:
            held = hold_out(context, after, [effect], seed, start, earlier=earlier)
        except EscalatorError:  # without it no machine runs with these tolerances: nothing is said
            gained.append(True)
            continue
        gained.append(held.channels is None or held.significant)
    return gained


def with_named_alone(
    context: Context,
    walked: Walked,
    named: Sequence[tuple[Found, float]],
    bench: Bench,
    jobs: int = 1,
) -> tuple[list[tuple[Found, float]], Beside] | None:
    """Fit the named effects anew where others were found beside them that are not named.

    Returns
    -------
    named : list of (Found, probability)
        Those that stay, with their numbers, before those that do not.
    after : Beside
        The machine with those that stay.
    None where all are named, or none is.
    """
    kept = [(found, p) for found, p in named if p >= NAMED]
    refused = [(found, p) for found, p in named if p < NAMED]
    if not (kept and refused):
        return None
    effects = [found.proposal for found, _ in kept]
    start = walked.before
    is_first = [found for found, _ in kept] == list(walked.found[: len(kept)])
    if is_first and len(walked.stages) > len(kept):
        # the tolerances as they fitted beside these, before what is refused was found
        start = walked.stages[len(kept)]
    polished = bench.again(context, freed(start, effects), effects, jobs)
    numbers = refitted([found for found, _ in kept], polished)
    rows = [(found, p) for found, (_, p) in zip(numbers, kept, strict=True)]
    return [*rows, *refused], freed(polished.place, effects)


def left_open(
    context: Context, walked: Walked, named: Sequence[tuple[Found, float]], rest: Unexplained
) -> Unexplained:
    """Return what stays unexplained once it is known which effects are named.

    What a law that is not believed fits is explained by nothing: where none is named, all of it.
    """
    if not walked.found or any(p >= NAMED for _, p in named):
        return rest
    return look(context, walked.before, walked.before)
