"""Fits beside effects of single links at the cost of fits without: what these do is run once and added."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from escalator_twin.causes.application import apply
from escalator_twin.diagnosis.context import Context
from escalator_twin.diagnosis.free import of_machine
from escalator_twin.diagnosis.knobs import knobs_of, turn_all
from escalator_twin.diagnosis.loops import LOCAL
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.stage import run_beside
from escalator_twin.machine import Deviation
from escalator_twin.physics.rollout import Trace


def leaned(
    context: Context, known: Sequence[Proposal], turned: Mapping[str, float]
) -> tuple[Context, list[Proposal]] | None:
    """Return a context in which effects of single links, axles and steps are added to every run.

    Without them the chain is the same again after every pitch, and a run takes a twentieth. To first order a
    further effect, or a tolerance, does the same with them as without.

    Parameters
    ----------
    context : Context
    known : sequence of Proposal
        Effects of machine and measurement.
    turned : mapping of tolerance to float
        Where the effects were fitted, standard deviations.

    Returns
    -------
    context : Context
    rest : list of Proposal
        The machine's effects that are not in it.

    None where there is nothing to leave out.
    """
    machine = [k for k in known if of_machine(k)]
    rest = [k for k in machine if k.cause not in LOCAL]
    if len(rest) == len(machine) or context.setting.added is not None:
        return None
    whole, alone = (
        _run(context, tuple(k.deviation for k in some), turned) for some in (machine, rest)
    )
    if whole.columns.shape != alone.columns.shape:
        return None
    added = replace(
        whole,
        columns=whole.columns - alone.columns,
        place_m=whole.place_m - alone.place_m,
        rack_m=whole.rack_m - alone.rack_m,
    )
    return replace(context, setting=replace(context.setting, added=added)), rest


def _run(
    context: Context, deviations: tuple[Deviation, ...], turned: Mapping[str, float]
) -> Trace:
    machine, setting = apply(context.machine, deviations), context.setting
    knobs = knobs_of(machine, setting.experiment)
    return run_beside(*turn_all(machine, setting.experiment, knobs, dict(turned)), setting)
