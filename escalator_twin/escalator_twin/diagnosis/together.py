"""What the searched recordings of one machine say of its effects' sizes together."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

from escalator_twin.diagnosis.campaign import Joint, MANY, pooled, Sized
from escalator_twin.diagnosis.conclusion import NAMED
from escalator_twin.diagnosis.context import Beside, Context
from escalator_twin.diagnosis.diagnose import Diagnosis
from escalator_twin.diagnosis.found import Found
from escalator_twin.diagnosis.free import freed, of_machine
from escalator_twin.diagnosis.points import Part
from escalator_twin.diagnosis.proposals import Proposal, same_place
from escalator_twin.diagnosis.shared import fit_together, is_shared
from escalator_twin.errors import EscalatorError

# Times the chi squared that the searches leave, each beside tolerances of its own: where one machine's leave more, the
# recordings are not of one machine as the twin has it. Twelve tolerances in each of four recordings are worth 50 of
# some 40000; two that were fitted each by itself left 7623 and 11781, where one machine left 7548 and 11532 (seed
# 251114, development).
MOST_TOGETHER = 1.25


@dataclass(frozen=True)
class Together:
    """Sizes and tolerances that fit the searched recordings together.

    Attributes
    ----------
    effects : mapping of int to Sized
        By which group of `union_of` each is, with how its numbers move as one recording is left out.
    groups : frozenset of int
        Of all effects of the machine beside which they were fitted.
    turned : mapping of tolerance to float
        Standard deviations.
    """

    effects: Mapping[int, Sized]
    groups: frozenset[int]
    turned: Mapping[str, float]

    def holds(self, accepted: Sequence[Joint], groups: 'Groups') -> bool:
        """Tell whether all effects beside which sizes were fitted were accepted in the end."""
        named = [joint.found.proposal for joint in accepted]
        return all(
            any(same_place(groups[k][0][0].proposal, one) for one in named) for k in self.groups
        )


Groups = Sequence[Sequence[tuple[Found, float]]]


def chosen_of(groups: Groups, n_scouts: int) -> list[int]:
    """Return which effects are of the machine and named by more than one of many searches.

    What one alone names is most often taken for an effect there.
    """
    return [
        k
        for k, group in enumerate(groups)
        if of_machine(group[0][0].proposal) and (n_scouts < MANY or len(group) > 1)
    ]


def is_worth_it(groups: Groups, n_scouts: int) -> bool:
    """Tell whether there is an effect whose size all recordings have in common, beside tolerances."""
    if n_scouts < 2:
        return False
    return any(is_shared(groups[k][0][0].proposal) for k in chosen_of(groups, n_scouts))


def fitted_together(
    contexts: Sequence[Context],
    scouts: Sequence[Diagnosis | None],
    groups: Groups,
    jobs: int = 1,
) -> Together | None:
    """Fit what the searches name to all of their recordings; None where that leaves more than they do.

    Parameters
    ----------
    contexts : sequence of Context
        Of every recording, as `prepare_tolerances` gives them.
    scouts : sequence of Diagnosis or None
        Of each that was searched; another has what these name.
    groups : sequence of groups
        As `union_of` gives them.
    jobs : int
        Recordings at a time.
    """
    searched = [scout for scout in scouts if scout is not None]
    chosen = chosen_of(groups, len(searched))
    known = {k: pooled([(f.proposal, f.sd) for f, _ in groups[k]]) for k in chosen}
    sized = [k for k in chosen if is_shared(known[k].proposal)]
    others = [known[k].proposal for k in chosen if k not in sized]
    effects = tuple(known[k].proposal for k in sized)
    faults = [g[0][0].proposal for g in groups if len(g) == len(searched)]
    parts = [
        Part(
            context,
            effects,
            own_of(scout, others),
            partial(_free, measured_in(scout, faults)),
            scout.turned if scout else {},
            sized_by(scout, effects, others),
        )
        for context, scout in zip(contexts, scouts, strict=True)
    ]
    try:
        found = fit_together(parts, jobs)
    except EscalatorError:
        return None
    pairs = [
        (level, scout.level)
        for level, scout in zip(found.levels, scouts, strict=True)
        if scout is not None
    ]
    if sum(level for level, _ in pairs) > MOST_TOGETHER * sum(own for _, own in pairs):
        return None
    rows = zip(found.effects, found.spread, strict=True)
    return Together(dict(zip(sized, rows, strict=True)), frozenset(chosen), found.turned)


def needs_no_phase(groups: Groups, n_scouts: int) -> bool:
    """Tell whether a recording that was not searched can be run with all effects of the machine."""
    chosen = chosen_of(groups, n_scouts)
    return all('phase_rad' not in groups[k][0][0].proposal.parameters for k in chosen)


def own_of(scout: Diagnosis | None, effects: Sequence[Proposal]) -> tuple[Proposal, ...]:
    """Return effects as one search has them: how a roller stood and a wave began is its own.

    Where it does not name one, it has the others' numbers, or none where it had to have a phase.
    """
    rows = []
    for effect in effects:
        there = _as_named(scout, effect)
        if there is not None:
            rows.append(there)
        elif 'phase_rad' not in effect.parameters:
            rows.append(effect)
    return tuple(rows)


def sized_by(
    scout: Diagnosis | None, effects: Sequence[Proposal], others: Sequence[Proposal]
) -> tuple[Proposal, ...]:
    """Return effects as one search has them; empty where it does not name them and all ``others``."""
    if any(_as_named(scout, other) is None for other in others):
        return ()
    rows = [_as_named(scout, effect) for effect in effects]
    return tuple(
        replace(effect, parameters=one.parameters, location=one.location)
        for effect, one in zip(effects, rows, strict=True)
        if one is not None and None not in rows
    )


def _as_named(scout: Diagnosis | None, effect: Proposal) -> Proposal | None:
    """Return an effect as a search has it, None where it does not name it."""
    return next((one for one in _named(scout) if same_place(effect, one)), None)


def measured_in(scout: Diagnosis | None, all_named: Sequence[Proposal]) -> list[Proposal]:
    """Return the faults of the measurement that a search names; without one, those that all name."""
    named = all_named if scout is None else _named(scout)
    return [effect for effect in named if not of_machine(effect)]


def _named(scout: Diagnosis | None) -> list[Proposal]:
    rows = () if scout is None else scout.found
    return [found.proposal for found, probability in rows if probability >= NAMED]


def _free(effects: Sequence[Proposal], place: Beside) -> Beside:
    return freed(place, effects)
