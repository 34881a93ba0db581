"""The walk from a placed recording to its effects: search, simulate, weigh, accept, again."""

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np

from escalator_twin.causes.registry import KNOWN
from escalator_twin.diagnosis.context import (
    Beside,
    beside,
    Context,
    tuned,
    with_own_tolerances,
)
from escalator_twin.diagnosis.drive import locks, refine_drive, refine_wave
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.refine import refine, Refined
from escalator_twin.diagnosis.search import FAMILIES, Search, search_all
from escalator_twin.diagnosis.search_more import MORE
from escalator_twin.diagnosis.stage import Stage
from escalator_twin.diagnosis.unexplained import by_channel, is_open
from escalator_twin.diagnosis.verdict import evidence_of, size_in_tolerances, weigh, Weighed
from escalator_twin.diagnosis.view import View
from escalator_twin.errors import EscalatorError

MOST_EFFECTS = 3
CONTENDERS = 4  # proposals that are simulated in a round
OF_ONE_CAUSE = 2
WORTH = 0.35  # of the best proposal's gain, from which a proposal is simulated
CLOSE = 0.6  # of the best gain, from which a second one is aligned anew as well
LEAST_GAIN = 25.0  # of chi squared: below it nothing is simulated
ACCEPT = 0.5  # probability from which an effect is accepted and taken out before the next round
FREED = 100.0  # by how much a nuisance's prior is widened once it is an effect
# An accepted law is never quite the machine's: what it leaves looks like a smaller effect. A further
# effect must explain more than these shares of what the others did; more among causes that act
# through the same part.
SHARE_OF_FIRST = 0.01
SHARE_OF_KIN = 0.3
KIN = (
    frozenset({
        'tensioner_friction', 'tensioner_stop', 'tensioner_stiffness', 'tensioner_preload',
        'landing_length', 'chain_elongation', 'guide_drag', 'rolling_resistance',
    }),
    frozenset({'roller_eccentricity', 'roller_flat', 'guide_step'}),
    frozenset({'drive_ripple', 'drive_hunting', 'drive_stiffness'}),
    frozenset({'load_distribution', 'step_mass', 'load_offset', 'roller_drag', 'link_stiffness'}),
)  # fmt: skip
IN_CHAIN = 0.5  # of what such a cause explains: in forces and tensioner
# Causes that change the machine so much that its tolerances act otherwise.
MOVES_RESONANCE = frozenset({
    'tensioner_friction', 'tensioner_stop', 'tensioner_stiffness', 'tensioner_preload',
    'drive_stiffness', 'chain_elongation', 'landing_length', 'rolling_resistance',
    'truss_resonance',
})  # fmt: skip
DRIVE = ('drive_hunting', 'drive_ripple')

Say = Callable[[str], None]


@dataclass(frozen=True)
class Found:
    """An accepted effect.

    Attributes
    ----------
    proposal : Proposal
        With the fitted numbers.
    probability : float
    sd : mapping of parameter to float
        By chi squared alone.
    gain : float
        Fall of chi squared.
    rivals : tuple of Weighed
        All that was weighed with it, best first.
    """

    proposal: Proposal
    probability: float
    sd: dict[str, float]
    gain: float
    rivals: tuple[Weighed, ...]


@dataclass(frozen=True)
class Walked:
    """What the walk found in one recording.

    Attributes
    ----------
    found : tuple of Found
        In the order of their acceptance.
    before, after : Beside
        The machine as described, and with the effects.
    weighed : tuple of Weighed
        The candidates of the last round, which accepted none.
    """

    found: tuple[Found, ...]
    before: Beside
    after: Beside
    weighed: tuple[Weighed, ...]


def of_machine(proposal: Proposal) -> bool:
    """Tell whether a proposal is of the machine, and not of its measurement."""
    return KNOWN[proposal.cause].of_machine


@dataclass(frozen=True)
class Bench:
    """What the walk asks of a kind of machine.

    Attributes
    ----------
    propose : callable
        Takes context, comparison and simulations at a time; returns proposals, best first.
    simulate : callable
        Takes the same with proposals before the last; returns them refined by the twin.
    anew : callable
        Takes context, deviations, simulations at a time, tolerances to begin with, and whether
        the deviations change what tolerances do; returns context and comparison with them.
    shows : callable
        Takes the comparisons before and after; tells whether an effect that moves a resonance
        explains what such an effect must.
    bare : callable
        Takes the comparison before and the effects; returns the one that they are judged against.
    """

    propose: Callable[[Context, Beside, int], list[Proposal]]
    simulate: Callable[[Context, Beside, Sequence[Proposal], int], list[Refined]]
    anew: Callable[..., tuple[Context, Beside]]
    shows: Callable[[Beside, Beside], bool]
    bare: Callable[[Beside, Sequence[Proposal]], Beside]


def walk(
    context: Context,
    jobs: int = 1,
    start: Sequence[Proposal] = (),
    say: Say | None = None,
    bench: 'Bench | None' = None,
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
    """
    bench = bench or LINKED
    found: list[Found] = []
    before = place = freed(context.place or beside(context), start)
    weighed: list[Weighed] = []
    for _ in range(MOST_EFFECTS):
        if found and not is_open(place, context.floor):
            break
        proposals = bench.propose(context, place, jobs)
        contenders = choose(proposals)
        refined = bench.simulate(context, place, contenders, jobs)
        weighed = weigh(_candidates(proposals, refined))
        if say is not None:
            for row in weighed[:4]:
                say(
                    f'{row.proposal.cause} {row.proposal.location} gain {row.gain:.1f} '
                    f'p {row.probability:.3f}'
                )
        if not weighed or weighed[0].probability < ACCEPT or is_left_over(weighed[0], found):
            break
        top = weighed[0]
        match = next((r for r in refined if r.proposal is top.proposal), None)
        sd = dict(match.sd) if match is not None else dict(top.proposal.sd)
        found.append(Found(top.proposal, top.probability, sd, top.gain, tuple(weighed)))
        proposals_now = [*start, *(f.proposal for f in found)]
        deviations = tuple(p.deviation for p in proposals_now if of_machine(p))
        stood_for = {p.nuisance for p in proposals_now}
        way = {k: z for k, z in place.stage.turned.items() if k not in stood_for}
        moves = top.proposal.cause in MOVES_RESONANCE
        context, after = bench.anew(context, deviations, jobs, way, anew=moves)
        after = freed(after, proposals_now)
        if moves and not bench.shows(place, after):
            found.pop()
            break
        place = after
    return Walked(tuple(found), before, place, tuple(weighed))


def shows_in_chain(before: Beside, after: Beside) -> bool:
    """Tell whether what an effect explains is in forces and tensioner, not in rattling alone.

    A change of the carriage, the chain or the drive acts through the chain. Accelerations alone
    may fall by chance: any change rolls the rattling rollers' dice anew.
    """
    observation = before.stage.observation
    fall = by_channel(before) - by_channel(after)
    quiet = np.array(
        [
            before.stage.machine.instruments.sensor(c).quantity != 'step_acceleration'
            for c in observation.channels
        ]
    )
    total = float(np.maximum(fall, 0.0).sum())
    return float(fall[quiet].sum()) > IN_CHAIN * total


def is_left_over(top: Weighed, found: Sequence[Found]) -> bool:
    """Tell whether a further effect is no more than what an accepted law leaves."""
    for earlier in found:
        kin = any({top.proposal.cause, earlier.proposal.cause} <= group for group in KIN)
        same = top.proposal.cause == earlier.proposal.cause
        share = SHARE_OF_KIN if kin or same else SHARE_OF_FIRST
        if top.gain < share * earlier.gain:
            return True
    return False


def freed(place: Beside, effects: Sequence[Proposal]) -> Beside:
    """Return the comparison with the nuisance that an effect of the measurement stands for free.

    The tolerance that an effect of the machine stands for stays as it is: the effect is its size.
    """
    stage = place.stage
    columns = stage.white_nuisance
    for effect in effects:
        if of_machine(effect):
            continue
        names = stage.nuisance.names
        if effect.cause == 'gauge_drift':
            extra = stage.whiten(creep(stage, effect)[:, :, None])
            columns = np.concatenate([columns, extra * np.float32(FREED)], axis=1)
            nuisance = replace(stage.nuisance, names=(*names, f'effect/{len(names)}'))
            stage = replace(stage, nuisance=nuisance)
            continue
        columns = columns.copy()
        for k, name in enumerate(names):
            if effect.nuisance is not None and name.startswith(effect.nuisance):
                columns[:, k] *= FREED
    stage = replace(stage, white_nuisance=columns)
    return replace(place, stage=stage, fitted=stage.fit(place.model))


def creep(stage: Stage, effect: Proposal) -> np.ndarray:
    """Return the creep of a link's gauges over the recording by its strain, (n, c)."""
    whole = np.zeros(stage.observation.measured.shape, np.float32)
    for k, channel in enumerate(stage.observation.channels):
        sensor = stage.machine.instruments.sensor(channel)
        if sensor.name == effect.location.get('link'):
            part = np.linspace(0.0, 1.0, len(whole))
            c = effect.parameters['curvature']
            shape = part if c == 0.0 else (1.0 - np.exp(-c * part)) / (1.0 - np.exp(-c))
            whole[:, k] = sensor.scale * sensor.sign * shape * effect.parameters['strain']
    return whole


def propose(context: Context, place: Beside, jobs: int) -> list[Proposal]:
    """Return what all families of causes propose, best first."""
    view = View.of(
        context.machine,
        place.stage.observation,
        context.responses,
        context.setting.experiment.direction,
    )
    search = Search(view, place.fitted, place.stage, place.model, jobs)
    return search_all(search, FAMILIES + MORE)


def choose(proposals: Sequence[Proposal]) -> list[Proposal]:
    """Return the proposals that are worth a simulation, best first."""
    machine = [p for p in proposals if of_machine(p)]
    if not machine:
        return []
    least = max(LEAST_GAIN, WORTH * machine[0].gain)
    chosen: list[Proposal] = []
    for proposal in machine:
        if len(chosen) == CONTENDERS or (proposal.gain < least and not proposal.nuisance):
            continue
        if proposal.nuisance and size_in_tolerances(proposal) < 2.0:
            continue
        if sum(p.cause == proposal.cause for p in chosen) < OF_ONE_CAUSE:
            chosen.append(proposal)
    return chosen


def simulate(
    context: Context, place: Beside, contenders: Sequence[Proposal], jobs: int
) -> list[Refined]:
    """Refine contenders with the twin, then align the best anew and refine them again."""
    single = [p for p in contenders if p.cause not in DRIVE]
    pairs = _pairs(contenders)
    with ThreadPoolExecutor(max(1, jobs)) as pool:
        first = [
            r
            for r in pool.map(lambda p: refine(place.stage, place.model, place.fitted, p), single)
            if r is not None
        ]
        drives = list(
            pool.map(
                lambda pair: refine_drive(place.stage, place.model, place.fitted.chi2, *pair),
                pairs,
            )
        )
        refined = first + [r for pair in drives for r in pair]
        refined.sort(key=lambda r: -r.gain)
        leading = [r for r in refined if r.gain > CLOSE * refined[0].gain][:2]
        again = list(pool.map(lambda r: realigned(context, place, r), leading))
    rest = [r for r in refined if all(r is not one for one in leading)]
    return sorted(_locked(context, place, again + rest), key=lambda r: -r.gain)


def _locked(context: Context, place: Beside, refined: list[Refined]) -> list[Refined]:
    """Weigh hunting against ripple of one wave by the same runs."""
    waves = {
        cause: next((r for r in refined if r.proposal.cause == cause), None) for cause in DRIVE
    }
    hunting, ripple = waves['drive_hunting'], waves['drive_ripple']
    if hunting is None or ripple is None or not refined:
        return refined
    best = max(hunting.gain, ripple.gain)
    if best < CLOSE * max(r.gain for r in refined):
        return refined
    known = place.stage.machine.deviations[len(context.machine.deviations) :]
    anew = beside(context, (*known, hunting.proposal.deviation), steps=1)
    bare = replace(anew.stage, machine=place.stage.machine)
    in_time, in_travel = locks(bare, bare.run(), hunting.proposal)
    low = min(in_time, in_travel)
    weighed = {
        id(hunting): replace(hunting, gain=best - (in_time - low)),
        id(ripple): replace(ripple, gain=best - (in_travel - low)),
    }
    return [weighed.get(id(r), r) for r in refined]


def _pairs(contenders: Sequence[Proposal]) -> list[tuple[Proposal, Proposal]]:
    """Return hunting and ripple of one frequency together."""
    hunting = [p for p in contenders if p.cause == 'drive_hunting']
    ripple = [p for p in contenders if p.cause == 'drive_ripple']
    return [
        (h, r)
        for h in hunting
        for r in ripple
        if h.parameters['phase_rad'] == r.parameters['phase_rad']
    ]


def realigned(context: Context, place: Beside, refined: Refined) -> Refined:
    """Align the recording anew with a refined cause, and refine it there once more."""
    known = place.stage.machine.deviations[len(context.machine.deviations) :]
    without = refined.proposal.nuisance
    turned = {k: v for k, v in place.stage.turned.items() if k != without}
    deviations = (*known, refined.proposal.deviation)
    try:
        if refined.proposal.cause in MOVES_RESONANCE:
            context = with_own_tolerances(context, deviations, turned=turned)
        anew = beside(context, deviations, turned=turned)
    except EscalatorError:
        return refined
    bare = replace(anew.stage, machine=place.stage.machine)
    if bare.white_nuisance.shape[1] == place.stage.white_nuisance.shape[1]:
        bare = replace(bare, white_nuisance=bare.white_nuisance * _widths(place))
    base = bare.run()
    again: Refined | None
    if refined.proposal.cause in DRIVE:
        in_time = refined.proposal.cause == 'drive_hunting'
        again = refine_wave(bare, base, place.fitted.chi2, refined.proposal, in_time)
    else:
        again = refine(bare, base, bare.fit(base), refined.proposal, steps=2)
    if again is None:
        return refined
    gain = place.fitted.chi2 - again.fitted.chi2
    return replace(again, gain=gain) if gain > refined.gain else refined


def _widths(place: Beside) -> np.ndarray:
    """Return by how much each nuisance's prior was widened, (q,)."""
    plain = place.stage.whiten(place.stage.nuisance.columns[:, :, :])
    now = place.stage.white_nuisance[:, : plain.shape[1]]
    power = np.sqrt(np.sum(now**2, axis=0) / np.maximum(np.sum(plain**2, axis=0), 1e-30))
    return np.where(power > 2.0, FREED, 1.0).astype(np.float32)


def _candidates(
    proposals: Sequence[Proposal], refined: Sequence[Refined]
) -> list[tuple[Proposal, float]]:
    """Return what is weighed: simulated gains, and linear ones of what was not simulated."""
    done = {(r.proposal.cause, _place(r.proposal)) for r in refined}
    rows = [(r.proposal, r.gain) for r in refined]
    cap = max((r.gain for r in refined), default=0.0)
    for proposal in proposals:
        if (proposal.cause, _place(proposal)) in done:
            continue
        if of_machine(proposal):
            # not simulated: nothing that was proposed as less is believed to be more
            if evidence_of(proposal, proposal.gain) > 0.0 and proposal.gain < cap:
                rows.append((proposal, proposal.gain))
        else:
            rows.append((proposal, proposal.gain))
    return rows


def _place(proposal: Proposal) -> str:
    return ', '.join(f'{k}={v}' for k, v in sorted(proposal.location.items()) if k != 's_m')


def as_it_was(before: Beside, _: Sequence[Proposal]) -> Beside:
    """Return the comparison that effects are judged against: the machine within tolerance."""
    return before


LINKED = Bench(propose, simulate, tuned, shows_in_chain, as_it_was)
