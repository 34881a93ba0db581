"""Beside effects whose sizes are known: fit what is a recording's own, and the tolerances."""

from collections.abc import Sequence
from dataclasses import replace

from escalator_twin.diagnosis.context import Beside, Context
from escalator_twin.diagnosis.joint import Free, JointFit, judged
from escalator_twin.diagnosis.loops import LOCAL
from escalator_twin.diagnosis.polish import farther, polish, polish_whole, Polished
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.tuning import WORTH_A_ROUND
from escalator_twin.diagnosis.unexplained import is_open

TREADS = ('roller_eccentricity', 'roller_flat')
OWN = ('phase_rad', 'slip')  # of a tread, in every recording another
MOST_STEPS = 2  # of fitting these: time; most of what more steps gain is gained
MOST_KICKS = 3  # each costs four runs of every tolerance


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
    own = tuple(replace(e, fitted=OWN if e.cause in TREADS else ()) for e in effects)
    if any(e.cause in LOCAL and 'side' in e.location for e in effects):
        return polish(context, own, place.stage.turned, free, steps=MOST_STEPS, is_near=True)
    return Polished(context, place if free is None else free(place), own, ())


def led_whole(found: Polished, free: Free | None = None) -> Polished:
    """Tune the tolerances on with the effects themselves in every run, where much is left open.

    `tuned` keeps what effects of single links do. Beside a longer chain, how a longer link pulls is
    another with stiffer contacts: by 0.6 of itself where these were 2 standard deviations off.

    Parameters
    ----------
    found : Polished
        As `settled` returns it.
    free : callable, optional
        As of `settled`.
    """
    for _ in range(MOST_KICKS if any(e.cause in LOCAL for e in found.effects) else 0):
        if not is_open(found.place, found.context.floor):
            break
        turned = farther(found, worth=WORTH_A_ROUND)
        if turned is None:
            break
        near = JointFit(found.context, (), free).beside(found.effects, turned)
        whole = polish_whole(replace(found, place=near), free)
        if judged(whole.place, whole.effects) >= judged(found.place, found.effects):
            break
        found = whole
    return found
