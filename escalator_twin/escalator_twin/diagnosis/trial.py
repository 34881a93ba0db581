"""Run the twin with what a search proposes, and fit the best of it together with the tolerances."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

from escalator_twin.diagnosis.afar import Afar
from escalator_twin.diagnosis.context import Beside, Context
from escalator_twin.diagnosis.drive import refine_drive
from escalator_twin.diagnosis.fitting import (
    approached,
    fitted_beside,
    fitted_near,
    MOVES_RESONANCE,
    plain,
)
from escalator_twin.diagnosis.floor import Floor, SHAKING
from escalator_twin.diagnosis.frames import best_frame
from escalator_twin.diagnosis.free import freed, of_machine
from escalator_twin.diagnosis.loops import LOCAL
from escalator_twin.diagnosis.polish import polish_kicked, polish_whole, Polished
from escalator_twin.diagnosis.proposals import Proposal, same_place
from escalator_twin.diagnosis.refine import refine, Refined
from escalator_twin.diagnosis.scan import scored
from escalator_twin.diagnosis.search import SIDES
from escalator_twin.diagnosis.stretches import best_stretch
from escalator_twin.diagnosis.tried import Tried
from escalator_twin.diagnosis.unexplained import excess_of, is_open, SIGMAS
from escalator_twin.diagnosis.waves import best_wave_alone, DRIVE, locked, pairs

CLOSE = 0.8  # of the best gain, from which a second one is fitted with the tolerances as well
FAR_ABOVE = 2.0  # times a chi squared: what fitting will not make up for
CLOSEST = 0.85  # the same of what was sought from afar
# Of what a recording holds above a good machine's: a cause that leaves less is followed, and what else there
# is comes beside it.
MOST_LEFT = 0.25
FIRST_STEPS = 1  # of a contender, before the best is known
# Fall of chi squared from which what an effect does hangs on the tolerances by more than noise: a
# tenth of it is some standard deviations.
LARGE = 300.0
# Of what is left above a good machine's: a step with all tolerances run beside the effect that gains less
# is the last.
WORTH = 0.05
KICKED = 3  # times that one tolerance is turned far beside the best effect of a single link
# Of what a recording holds above a good machine's: beside an effect that leaves less than the first, turning
# tolerances far changed a soft link's factor from 0.304 to 0.303, a drag from 122 to 121 N; less than the second,
# fitting on changed an eccentricity by a fifth of a percent.
KICK_LEFT, WHOLE_LEFT = 0.01, 0.005
# Whose ends or frequency are looked for with the twin itself: the best of each.
SCANS = {'guide_drag': best_stretch, 'truss_resonance': best_frame}
# Whose sides look alike but for the axle's racking. A side that explains less, run once, than this share of
# what the first one did is not fitted. An argument, not measured: sides that can be taken for each other explain
# about as much; of one flat spot and one soft link, named on the right side, the other explained 0.5 and 0.3.
ALIKE = 0.6
SIDED = ('roller_drag', 'link_stiffness', 'roller_flat', 'guide_step')


Worth = Callable[[Proposal, float], bool]


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
    single = [p for p in contenders if p.cause not in DRIVE]
    if afar is not None:
        # beside tolerances that were tuned to them they look like others
        moving = [p for p in single if p.cause in SCANS and p.cause in MOVES_RESONANCE][:1]
        single = [p for p in single if p.cause not in SCANS or p.cause not in MOVES_RESONANCE]
    waves_of = pairs(contenders, stage.observation.frame)
    with ThreadPoolExecutor(max(1, jobs)) as pool:
        for cause, scan in SCANS.items():
            scanned = [p for p in single if p.cause == cause]
            single = [p for p in single if p.cause != cause]
            single += [scan(stage, base, fitted, p, jobs) for p in scanned[:1]]
        first = [
            r
            for r in pool.map(lambda p: refine(stage, base, fitted, p, FIRST_STEPS), single)
            if r is not None
        ]
        waves = pool.map(
            lambda pair: refine_drive(stage, base, fitted, pair[0], pair[1], jobs), waves_of
        )
        refined = first + [r for pair in waves for r in pair]
        refined.sort(key=lambda r: -r.gain)
        leading = best_wave_alone([r for r in refined if r.gain > CLOSE * refined[0].gain])[:2]
        leading = [r for r in leading if worth is None or worth(r.proposal, r.gain)]
        fitted_again = _fitted_all(context, place, known, leading, jobs)

        def gain_of(proposal: Proposal) -> float:
            return max((p.gain for p in scored(stage, base, fitted, [proposal])), default=0.0)

        fitted_again += _other_sides(place, known, refined, fitted_again, jobs, gain_of)
        if afar is not None and not is_closed(fitted_again, context.floor):
            proposals = [*afar.proposals, *(_scanned(afar.place, p, jobs) for p in moving)]
            sought = replace(afar, proposals=proposals)
            places = [place, *(t.polished.place for t in fitted_again if t.polished is not None)]
            done = tuple(fitted_again)

            def from_afar(one: Proposal, gain: float) -> bool:
                left = not is_done(place, done, one, context.floor)
                return left and (worth is None or worth(one, gain))

            fitted_again += _tried_afar(
                context, sought, place, known, pool, jobs, places, from_afar
            )
            if known or is_riddle(place, fitted_again, context.floor):
                fitted_again += _at_edges(context, afar, place, known, fitted_again, pool, jobs)
    rest = [plain(r) for r in refined if all(r is not one for one in leading)]
    tried = shared(place, locked(context, place, fitted_again + rest, jobs))
    tried.sort(key=lambda t: -t.gain)
    tried = _locked_better(known, tried, jobs)
    return [_settled(place, known, t, jobs) if k == 0 else t for k, t in enumerate(tried)]


def shared(place: Beside, tried: Sequence[Tried]) -> list[Tried]:
    """Take from what acts on a step directly what a rival explains there as well.

    Of most causes a step's x and z are not judged, since rattling rollers roll dice there, and of a
    rail's step they are. But a landing that is longer by millimetres moves where rollers change tracks:
    a rail's step there must explain more than that, where the landing explains as much elsewhere.
    """
    rivals = [t for t in tried if t.polished is not None and t.proposal.cause not in SHAKING]

    def fair(one: Tried) -> Tried:
        if one.proposal.cause not in SHAKING or one.polished is None:
            return one
        elsewhere, there = _falls(place, one.polished)
        falls = [_falls(place, t.polished) for t in rivals if t.polished is not None]
        explained = max((there for rest, there in falls if rest >= elsewhere), default=0.0)
        return replace(one, gain=one.gain - min(max(explained, 0.0), max(there, 0.0)))

    return [fair(one) for one in tried]


def _falls(place: Beside, polished: Polished) -> tuple[float, float]:
    """Return the fall of chi squared in the channels that no rattling shakes, and in the others."""
    rows = [(p.stage.judged(p.fitted), p.fitted.chi2) for p in (place, polished.place)]
    (before, whole_before), (after, whole_after) = rows
    return before - after, (whole_before - before) - (whole_after - after)


def _locked_better(known: Sequence[Proposal], tried: list[Tried], jobs: int) -> list[Tried]:
    """Fit the best with all else, where it is a wave that was fitted so with the other lock alone."""
    if not tried or tried[0].polished is not None or tried[0].proposal.cause not in DRIVE:
        return tried
    near = next((t.polished for t in tried if t.polished and t.proposal.cause in DRIVE), None)
    return tried if near is None else [fitted_near(known, tried[0], near, jobs), *tried[1:]]


def is_closed(tried: Sequence[Tried], floor: Floor) -> bool:
    """Tell whether an effect of one link, axle or step leaves no more than a good machine does.

    What the whole machine may have is of another form, and cannot do as well.
    """
    best = max((t for t in tried if t.polished is not None), key=lambda t: t.gain, default=None)
    return best is not None and best.proposal.cause in LOCAL and _closes(best, floor)


def is_riddle(place: Beside, tried: Sequence[Tried], floor: Floor) -> bool:
    """Tell whether a recording holds more than a good machine's and nothing fitted explains most of it."""
    if not is_open(place, floor, SIGMAS):
        return False
    most = MOST_LEFT * excess_of(place, floor)
    return not any(
        _closes(t, floor) or excess_of(t.polished.place, floor) < most
        for t in tried
        if t.polished is not None
    )


def is_done(place: Beside, tried: Sequence[Tried], proposal: Proposal, floor: Floor) -> bool:
    """Tell whether a proposal was fitted, as the best, and left nearly nothing of what was open.

    From another start it could explain no more than that.
    """
    best = max((t for t in tried if t.polished is not None), key=lambda t: t.gain, default=None)
    if best is None or best.polished is None or not same_place(best.proposal, proposal):
        return False
    return excess_of(best.polished.place, floor) < WHOLE_LEFT * excess_of(place, floor)


def _closes(tried: Tried, floor: Floor) -> bool:
    """Tell whether an effect that was fitted with all else leaves no more than a good machine."""
    return tried.polished is not None and not is_open(tried.polished.place, floor)


def _fitted_all(
    context: Context,
    place: Beside,
    known: Sequence[Proposal],
    leading: Sequence[Refined],
    jobs: int,
) -> list[Tried]:
    """Fit the leading causes, each from tolerances of its own.

    Where all are of one link, axle or step, which hardly move the tolerances, they begin where these
    fit beside the first.
    """
    turned = None
    if leading and all(r.proposal.cause in LOCAL - set(DRIVE) for r in leading):
        context, turned = approached(context, place, known, leading[0], jobs)
    # each with all jobs: one may end long before the other
    with ThreadPoolExecutor(max(1, jobs)) as pool:
        return list(
            pool.map(lambda r: fitted_beside(context, place, known, r, turned, jobs), leading)
        )


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

    def free(beside: Beside) -> Beside:
        return freed(beside, known)

    whole = polished
    # of what explains little, no turn of a tolerance makes more
    for _ in range(KICKED if left < MOST_LEFT * above else 0):
        if not is_open(whole.place, floor) or excess_of(whole.place, floor) < KICK_LEFT * above:
            break
        kicked = polish_kicked(whole, free, jobs, worth)
        if kicked is None:
            break
        whole = kicked
    if is_open(whole.place, floor) and excess_of(whole.place, floor) >= WHOLE_LEFT * above:
        whole = polish_whole(whole, free, jobs, worth)
    before = place.stage.judged(place.fitted, cause)
    gain = before - whole.place.stage.judged(whole.place.fitted, cause)
    if gain <= tried.gain:
        return tried
    return Tried(whole.effects[-1], gain, whole.sd[-1], whole)


def _other_sides(
    place: Beside,
    known: Sequence[Proposal],
    refined: Sequence[Refined],
    fitted: Sequence[Tried],
    jobs: int,
    gain_of: Callable[[Proposal], float],
) -> list[Tried]:
    """Fit the best on its other sides too, from the tolerances that it ended with.

    Where the sides differ by little, which is right must not hang on how far each fit has come.

    Parameters
    ----------
    refined : sequence of Refined
        All contenders.
    fitted : sequence of Tried
        The leading ones.
    gain_of : callable
        What a proposal that is run once gains at its best size.
    """
    best = max((t for t in fitted if t.polished is not None), key=lambda t: t.gain, default=None)
    if best is None or best.polished is None or best.proposal.cause not in SIDED:
        return []
    side = best.proposal.location.get('side')
    others = {
        str(r.proposal.location['side']): r
        for r in reversed(refined)
        if r.proposal.cause == best.proposal.cause
        and r.proposal.location['side'] != side
        and is_beside(r.proposal, best.proposal)
    }
    if side in SIDES and best.proposal.cause != 'guide_step':
        other = SIDES[1 - SIDES.index(str(side))]
        location = {**best.proposal.location, 'side': other}
        like = next(r for r in refined if r.proposal.cause == best.proposal.cause)
        mirrored = replace(best.proposal, location=location)
        others = {other: replace(like, proposal=mirrored, gain=gain_of(mirrored))}
    own = max(r.gain for r in refined if r.proposal.cause == best.proposal.cause)
    others = {name: r for name, r in others.items() if r.gain > ALIKE * own}
    turned = best.polished.place.stage.turned
    context = best.polished.context
    if best.proposal.cause in LOCAL:  # all leading ones began at the same tolerances
        done = [t.proposal for t in fitted if t.polished is not None]
        others = {
            name: r
            for name, r in others.items()
            if not any(same_place(r.proposal, d) for d in done)
        }
    found = [fitted_beside(context, place, known, r, turned, jobs) for r in others.values()]
    return [t for t in found if t.polished is not None]


def is_beside(one: Proposal, other: Proposal) -> bool:
    """Tell whether two proposals sit at the same place but for the side."""
    place = {**one.location, 'side': other.location['side']}
    return same_place(replace(one, location=place), other)


def _scanned(place: Beside, proposal: Proposal, jobs: int) -> Proposal:
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
    `try_all`.
    """
    base = afar.place

    def is_far(one: Refined) -> bool:
        cause = one.proposal.cause
        level = min(p.stage.judged(p.fitted, cause) for p in places)
        return base.stage.judged(base.fitted, cause) - one.gain >= FAR_ABOVE * level

    first = pool.map(
        lambda p: refine(base.stage, base.model, base.fitted, p, FIRST_STEPS), afar.proposals
    )
    refined = sorted((r for r in first if r is not None), key=lambda r: -r.gain)
    leading = [r for r in refined if r.gain > CLOSEST * refined[0].gain][:2]
    leading = [r for r in leading if worth is None or worth(r.proposal, r.gain)]
    # beside what changes the whole machine, what the tolerances are to take up is far above all else
    if not any(of_machine(k) and k.cause not in LOCAL for k in known):
        leading = [r for r in leading if not is_far(r)]
    return _fitted_afar(context, afar, place, known, leading, pool, jobs)


def _at_edges(
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
    nothing else closes what is open.
    """
    base = afar.place
    done = {t.proposal.cause for t in tried if t.polished is not None}
    edges = [e for e in afar.edges if e.cause not in done]
    runs = pool.map(lambda p: refine(base.stage, base.model, base.fitted, p, 0), edges)
    found = [r for r in runs if r is not None]
    return _fitted_afar(context, afar, place, known, found, pool, jobs)


def _fitted_afar(
    context: Context,
    afar: Afar,
    place: Beside,
    known: Sequence[Proposal],
    leading: Sequence[Refined],
    pool: ThreadPoolExecutor,
    jobs: int,
) -> list[Tried]:
    """Fit causes from the machine as described, no tolerance turned."""
    fitted = pool.map(lambda r: fitted_beside(afar.context, place, known, r, {}, jobs), leading)
    found = []
    for tried in fitted:
        if tried.polished is not None:
            # from here on with what every other cause does
            knobs = tried.polished.context.responses.knobs
            whole = replace(context, responses=replace(context.responses, knobs=knobs))
            found.append(replace(tried, polished=replace(tried.polished, context=whole)))
    return found
