"""Variants of one proposal, each run with the twin: which explains most, and how large it is then."""

from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.refine import INVERSE
from escalator_twin.diagnosis.regression import Fitted, score_each
from escalator_twin.diagnosis.stage import Stage
from escalator_twin.errors import EscalatorError
from escalator_twin.signals import Floats


def best_variant(
    stage: Stage, base: Floats, fitted: Fitted, variants: Iterable[Proposal], jobs: int = 1
) -> Proposal | None:
    """Return the variant that explains most, with its size; None where none explains anything.

    Parameters are those of `scored`.
    """
    return next(iter(scored(stage, base, fitted, variants, jobs)), None)


def scored(
    stage: Stage, base: Floats, fitted: Fitted, variants: Iterable[Proposal], jobs: int = 1
) -> list[Proposal]:
    """Return the variants that explain anything, each with its size, best first.

    Parameters
    ----------
    stage : Stage
    base : (n, c) float64
        Its model.
    fitted : Fitted
        What that leaves, with the nuisance.
    variants : iterable of Proposal
        The first of their fitted parameters is the size; one of no size is not run.
    jobs : int
        Simulations at a time.
    """

    def tried(one: Proposal) -> Proposal | None:
        key = one.fitted[0]
        given = one.parameters[key]
        if given <= 0.0:
            return None
        try:
            change = stage.run((one.deviation,)) - base
        except EscalatorError:
            return None  # no such machine
        score = score_each(fitted, stage.columns(change[:, :, None], one.cause))
        share, gain = float(score.size[0]), float(score.gain[0])
        if share <= 0.0:
            return None
        size = given / share if (one.cause, key) in INVERSE else given * share
        return replace(one, parameters={**one.parameters, key: size}, gain=gain)

    with ThreadPoolExecutor(max(1, jobs)) as pool:
        found = [one for one in pool.map(tried, variants) if one is not None]
    return sorted(found, key=lambda p: -p.gain)


def best_as_run(
    stage: Stage, fitted: Fitted, variants: Iterable[Proposal], jobs: int = 1
) -> Proposal | None:
    """Return the variant that explains most as it is, its size kept; None where none does.

    Parameters are those of `scored`.
    """
    return max(as_run(stage, fitted, variants, jobs), key=lambda p: p.gain, default=None)


def as_run(
    stage: Stage, fitted: Fitted, variants: Iterable[Proposal], jobs: int = 1
) -> list[Proposal]:
    """Return the variants that explain anything as they are, their sizes kept, in their order.

    Parameters are those of `scored`.
    """

    def tried(one: Proposal) -> Proposal | None:
        try:
            after = stage.fit(stage.run((one.deviation,)))
        except EscalatorError:
            return None
        gain = stage.judged(fitted, one.cause) - stage.judged(after, one.cause)
        return replace(one, gain=gain) if gain > 0.0 else None

    with ThreadPoolExecutor(max(1, jobs)) as pool:
        return [one for one in pool.map(tried, variants) if one is not None]
