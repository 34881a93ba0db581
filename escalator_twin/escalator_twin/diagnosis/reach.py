"""How much an effect of its reference's size changes, beside what is open."""

from dataclasses import replace

from escalator_twin.causes.registry import KNOWN
from escalator_twin.diagnosis.context import Beside
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.regression import score_each
from escalator_twin.diagnosis.verdict import neutral_of
from escalator_twin.signals import Floats

# Times the energy that an effect of its reference's size has, tolerances and instruments taken out: an effect twice as
# large has four times that. What leaves more open has another, stronger cause, which is to be found first; short
# dogs, on no list, left a million of chi squared, where a landing of 6 mm had 5000, and took half of a search of 166 s
# to see that two such effects were none (seed 9012).
MARGIN = 4.0


def reaches(place: Beside, effect: Proposal, model: Floats, excess: float) -> bool:
    """Tell whether what an effect changes is enough to explain what is open.

    Parameters
    ----------
    place : Beside
        The machine without it.
    effect : Proposal
    model : (n, c) float64
        The machine with it.
    excess : float
        Chi squared above a good machine's.
    """
    fitted, names = place.fitted, place.stage.nuisance.names
    if effect.nuisance in names:
        fitted = fitted.without(names.index(effect.nuisance))
    change = (model - place.model)[:, :, None]
    score = score_each(fitted, place.stage.columns(change, effect.cause))
    energy = 1.0 / float(score.sd[0]) ** 2
    return MARGIN * energy >= excess


def at_reference(effect: Proposal) -> Proposal:
    """Return an effect with its reference's size, on its own side of neutral; as it is where there is none."""
    key = effect.fitted[0]
    neutral = neutral_of(effect.cause, key)
    way = effect.parameters[key] - neutral
    law = next(p for p in KNOWN[effect.cause].parameters if p.name == key)
    references = [reference[key] for reference in KNOWN[effect.cause].references]
    for size in (*references, *(2.0 * neutral - r for r in references)):
        if (size - neutral) * way > 0.0 and law.low <= size <= law.high:
            return replace(effect, parameters={**effect.parameters, key: size})
    return effect
