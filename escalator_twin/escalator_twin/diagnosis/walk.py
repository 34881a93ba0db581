"""The walk from a placed recording to its effects: search, simulate, weigh, accept, again."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from math import inf

from escalator_twin.diagnosis.accepted import (
    found_of,
    left_of,
    match_of,
    placed_at,
    refitted,
    regrouped_found,
)
from escalator_twin.diagnosis.afar import Afar
from escalator_twin.diagnosis.bounds import Bounds
from escalator_twin.diagnosis.contenders import (
    ACCEPT,
    candidates,
    is_unrun,
    one_gauge,
)
from escalator_twin.diagnosis.context import Beside, beside, Context
from escalator_twin.diagnosis.found import Found, is_in_vain
from escalator_twin.diagnosis.free import freed, of_machine
from escalator_twin.diagnosis.linked import LINKED
from escalator_twin.diagnosis.lone import is_in_one_gauge
from escalator_twin.diagnosis.once import told_once
from escalator_twin.diagnosis.polish import Polished
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.remnants import without_remnants
from escalator_twin.diagnosis.seeking import seek, Sought
from escalator_twin.diagnosis.suggested import begun, NOTHING, Suggested
from escalator_twin.diagnosis.tried import Tried
from escalator_twin.diagnosis.unexplained import (
    explained_by,
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
    under_way = _Walk(context, bench or LINKED, start, jobs, say)
    under_way.begin(suggested)
    return under_way.to_its_end()


class _Walk:
    """A walk under way: the machine as it is known so far, and what was found in it.

    ``before`` and ``place`` are the machine as described and with what was found; ``weighed`` the candidates of
    the last round; ``stages`` the machine before each effect; ``anew`` how many effects were known where a
    round began once more.
    """

    def __init__(
        self,
        context: Context,
        bench: Bench,
        start: Sequence[Proposal],
        jobs: int,
        say: Say | None,
    ) -> None:
        self.context, self.bench, self.start, self.jobs = context, bench, start, jobs
        self.say: Say = say or (lambda _: None)
        self.before = self.place = freed(context.place or beside(context), start)
        self.found: list[Found] = []
        self.weighed: list[Weighed] = []
        self.left: Found | None = None
        self.last: Round | None = None
        self.stages: list[Beside] = []
        self.anew: set[int] = set()
        self.accepted = 0

    def begin(self, suggested: Suggested) -> None:
        """Begin beside what other recordings of the machine suggest, where it holds here."""
        first = begun(self.bench.again, self.context, self.place, self.start, suggested, self.jobs)
        if first is not None:
            polished, self.found = first
            self.context, self.place = polished.context, freed(polished.place, self.start)

    def to_its_end(self) -> Walked:
        """Go on until a round accepts nothing more."""
        rounds = 0
        while rounds < MOST_ROUNDS + len(self.anew) and self._round():
            rounds += 1
        stages = self.stages if len(self.stages) == len(self.found) else []
        return Walked(
            tuple(self.found),
            self.before,
            self.place,
            tuple(self.weighed),
            self.left,
            self.last,
            tuple(stages),
        )

    @property
    def known(self) -> list[Proposal]:
        """All effects so far."""
        return self._with(self.found)

    def _with(self, found: Sequence[Found]) -> list[Proposal]:
        return [*self.start, *(f.proposal for f in found)]

    def _round(self) -> bool:
        """Seek, weigh and accept once; tell whether to go on."""
        floor, room = self.context.floor, MOST_EFFECTS - len(self.found)
        bounds = Bounds.of(self.before, self.place, floor, self.found, room - 1)
        if room == 0 or (self.found and not (bounds.is_open or bounds.is_hidden)):
            return False
        place, known = self.place, self.known
        sought = seek(self.bench, self.context, place, known, bounds, self.jobs)
        self.last = Round(self.context, place, tuple(known), tuple(sought.proposals))
        if not sought.may_stand(bounds):
            self.weighed = weigh(candidates(sought.proposals, []))
            self.left = left_of(self.weighed, [])
            return False
        tried = self._weighed(sought, bounds)
        for row in self.weighed[:4]:
            effect = row.proposal
            self.say(
                f'{effect.cause} {effect.location} gain {row.gain:.1f} p {row.probability:.3f}'
            )
        if not self.weighed or self.weighed[0].probability < ACCEPT:
            return False
        top = self.weighed[0]
        match = match_of(top, tried)
        if match is not None and self._begins_anew(match):
            return True
        cause = top.proposal.cause
        if bounds.is_left_over(cause, top.gain):
            self.left = left_of(self.weighed, tried)
            return False
        if of_machine(top.proposal) and bounds.is_in_vain(cause, top.gain):
            return False
        self._accept(match)
        return self._may_hold_more()

    def _weighed(self, sought: Sought, bounds: Bounds) -> list[Tried]:
        """Run what was sought and weigh it; return what the twin was run with."""
        rival = max((by_data(p, p.gain) for p in one_gauge(sought.proposals)), default=-inf)
        worth = partial(bounds.is_worth_fitting, rival=rival)

        def attempt(contenders: list[Proposal], afar: Afar | None) -> list[Tried]:
            return self.bench.attempt(
                self.context, self.place, self.known, contenders, self.jobs, afar, worth
            )

        tried = attempt(sought.contenders(bounds), sought.afar)
        self.weighed = weigh(candidates(sought.proposals, tried))
        if self.weighed and is_unrun(self.weighed[0], tried):
            # what was not chosen leads once those that were are no effects: nothing is named unrun
            tried = [*tried, *attempt([self.weighed[0].proposal], None)]
            weighed = weigh(candidates(sought.proposals, tried))
            self.weighed = [w for w in weighed if not is_unrun(w, tried)]
        if self.last is not None:
            self.last = replace(self.last, tried=tuple(tried))
        return tried

    def _begins_anew(self, match: Tried) -> bool:
        """Tell whether tolerances without what leads are nearer; once, the next round begins beside them."""
        known = self.known
        if self.bench.nearer is None or len(self.found) in self.anew:
            return False
        nearer = self.bench.nearer(self.context, self.place, known, match, self.jobs)
        if nearer is None:
            return False
        self.anew.add(len(self.found))
        self._take(nearer, self.found)
        self.before = self.before if known else self.place
        # what was weighed beside the other machine says nothing here
        self.weighed, self.last = list(self.found[-1].rivals) if self.found else [], None
        return True

    def _accept(self, match: Tried | None) -> None:
        """Accept what leads, and drop or move what it shows to be none or elsewhere."""
        self.last = None
        self.accepted += 1
        self.stages.append(self.place)
        found = [*self.found, found_of(self.weighed, match)]
        fitted = None if match is None else match.polished
        polished = self._take(self._again(found) if fitted is None else fitted, found)
        once = told_once(self.found)
        if len(once) < len(self.found):
            polished = self._take(self._again(once), once)
            self.stages.pop()
        kept = without_remnants(self.found)
        if len(kept) < len(self.found):
            polished = self._take(self._again(kept), kept)
            polished = self._at_neighbours(polished)
        self._regroup(polished)
        self.found = [f for f in self.found if not _is_gone(f.proposal)]
        self.place = freed(self.place, self.known)

    def _may_hold_more(self) -> bool:
        """Tell whether a further round is worth its time."""
        place, floor, effects = self.place, self.context.floor, [f.proposal for f in self.found]
        explained = explained_by(self.before, place, floor)
        self.say(f'{len(effects)} effects explain {explained:.3f}')
        if is_in_vain(self.found, explained, MOST_EFFECTS - len(effects), self.accepted):
            return False
        if explained < LEAST_EXPLAINED and is_in_one_gauge(place, floor):
            return False  # the strongest of what a gauge may have leaves nearly all of what it has
        scattered = self.bench.is_scattered
        return scattered is None or not scattered(self.context, place, effects)

    def _again(self, found: Sequence[Found]) -> Polished:
        """Return effects fitted once more, from the machine as it is."""
        return self.bench.again(self.context, self.place, self._with(found), self.jobs)

    def _take(self, polished: Polished, found: Sequence[Found]) -> Polished:
        """Go on from a fit and the effects that it holds."""
        self.context, self.place = polished.context, polished.place
        self.found = refitted(found, polished)
        return polished

    def _at_neighbours(self, polished: Polished) -> Polished:
        """Move the last effect to a neighbour: it was chosen beside what turned out to be none."""
        if self.bench.neighbours is None or not is_open(self.place, self.context.floor):
            return polished
        moved = self.bench.neighbours(self.bench.again, polished, self.known, self.jobs)
        if moved is polished:
            return polished
        last_one = placed_at(self.found[-1], moved.effects[-1])
        return self._take(moved, [*self.found[:-1], last_one])

    def _regroup(self, polished: Polished) -> None:
        """Move effects to other places where they explain more together."""
        regroup, again = self.bench.regroup, self.bench.again
        if regroup is None:
            return
        other = regrouped_found(regroup, again, polished, self.start, self.found, self.jobs)
        if other is not None:
            self._take(*other)
            self.stages.clear()  # they hold it where it was


def _is_gone(proposal: Proposal) -> bool:
    """Tell whether nothing is left of an effect once a later one was fitted beside it."""
    return size_in_tolerances(proposal) < EFFECT_TOLERANCES
