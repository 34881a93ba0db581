"""Variants of one proposal, each run with the twin: which explains most, and how large it is then."""

from collections.abc import Iterable
from dataclasses import replace

from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.regression import Fitted, score_each
from escalator_twin.diagnosis.stage import Stage
from escalator_twin.errors import EscalatorError
from escalator_twin.signals import Floats


def best_variant(
    stage: Stage, base: Floats, fitted: Fitted, variants: Iterable[Proposal]
) -> Proposal | None:
    """Return the variant that explains most, with its size; None where none explains anything.

    Parameters
    ----------
    stage : Stage
    base : (n, c) float64
        Its model.
    fitted : Fitted
        What that leaves, with the nuisance.
    variants : iterable of Proposal
        The first of their fitted parameters is the size; one of no size is not run.
    """
    tried: list[Proposal] = []
    for one in variants:
        key = one.fitted[0]
        given = one.parameters[key]
        if given <= 0.0:
            continue
        try:
            change = (stage.run((one.deviation,)) - base) / given
        except EscalatorError:
            continue  # no such machine
        score = score_each(fitted, stage.columns(change[:, :, None], one.cause))
        size, gain = float(score.size[0]), float(score.gain[0])
        if size > 0.0:
            tried.append(replace(one, parameters={**one.parameters, key: size}, gain=gain))
    return max(tried, key=lambda p: p.gain, default=None)
