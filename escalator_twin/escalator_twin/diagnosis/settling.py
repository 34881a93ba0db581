"""Beside effects whose sizes are known: fit what is a recording's own, and the tolerances."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from escalator_twin.diagnosis.context import Beside, Context
from escalator_twin.diagnosis.descent import WORTH_A_ROUND
from escalator_twin.diagnosis.joint import Free, JointFit, judged
from escalator_twin.diagnosis.loops import LOCAL
from escalator_twin.diagnosis.polish import farther, polish, polish_whole, Polished
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.unexplained import is_open

TREADS = ('roller_eccentricity', 'roller_flat')
OWN = ('phase_rad', 'slip')  # of a tread, in every recording another
MOST_STEPS = 2  # of fitting these: time; most of what more steps gain is gained
MOST_KICKS = 3  # each costs four runs of every tolerance
# Of a fit with the effects in the runs: a step is a run of every tolerance, and a third one of seven recordings
# gained 0.02 to 0.6 % of chi squared, where the first two had 3 to 24 % (seed 251106, development).
WHOLE_STEPS = 2
WORTH_A_STEP = 30.0  # chi squared: a step of these that gains less is the last one
# Of chi squared: after a turn and fit that gain less, no other is tried. Out of the hollow the turns gained 16, 4
# and 3 %, where none leads on 1 % at most; each costs 20 to 50 s.
WORTH_ANOTHER = 0.015

GoesOn = Callable[[Beside, int], bool]


def settled(
    context: Context, place: Beside, effects: Sequence[Proposal], free: Free | None = None
) -> Polished:
    """Fit what of treads is each recording's own, and what only shows beside them; sizes stay.

    How a roller stood was read beside the machine as described, and how far the sides' stiffness against
    each other is off shows only beside what acts on one of them.

    Parameters
    ----------
    context : Context
        With the tolerances as they act in the machine with the effects.
    place : Beside
        That machine.
    effects : sequence of Proposal
        Of the machine, all of them.
    free : callable, optional
        Frees the nuisance that effects of the measurement stand for.

    Returns
    -------
    Polished
        Whose effects have nothing left to be fitted but what is each recording's own.
    """
    own = owned(effects)
    if any(e.cause in LOCAL and 'side' in e.location for e in effects):
        return polish(context, own, place.stage.turned, free, steps=MOST_STEPS, is_near=True)
    return Polished(context, place if free is None else free(place), own, ())


def owned(effects: Sequence[Proposal]) -> tuple[Proposal, ...]:
    """Return effects of which only what is each recording's own is left to be fitted."""
    return tuple(replace(e, fitted=OWN if e.cause in TREADS else ()) for e in effects)


def led_whole(
    found: Polished,
    free: Free | None = None,
    jobs: int = 1,
    worth_a_step: float = WORTH_A_STEP,
    worth_a_turn: float = WORTH_A_ROUND,
    goes_on: GoesOn | None = None,
    steps: int = WHOLE_STEPS,
) -> Polished:
    """Fit on with the effects themselves in every run, where much is left open.

    `tuned` keeps what effects of single links do. Beside a longer chain, how a longer link pulls is
    another with stiffer contacts: by 0.6 of itself where these were 2 standard deviations off. Slopes with
    the effects in the runs are followed first; where they lead no further, a tolerance is turned far.

    Parameters
    ----------
    found : Polished
        What is fitted of its effects is fitted on.
    free : callable, optional
        As of `settled`.
    jobs : int
        Simulations at a time.
    worth_a_step, worth_a_turn : float
        Chi squared: of these, one that gains less is the last.
    goes_on : callable, optional
        Takes the machine and how often a tolerance was turned: whether what is left is worth another turn,
        or at first any runs.
    steps : int
        By slopes, after each turn, at most.
    """
    if not any(e.cause in LOCAL for e in found.effects):
        return found
    for turn in range(1 + MOST_KICKS):
        if not is_open(found.place, found.context.floor):
            break
        if goes_on is not None and not goes_on(found.place, turn):
            break
        near = found
        if turn:
            turned = farther(found, jobs, worth_a_turn)
            if turned is None:
                break
            place = JointFit(found.context, (), free).beside(found.effects, turned)
            near = replace(found, place=place)
        whole = polish_whole(near, free, jobs, worth_a_step, steps)
        before, after = (judged(p.place, p.effects) for p in (found, whole))
        if after < before:
            found = whole
        if turn and before - after < WORTH_ANOTHER * before:
            break
    return found
