"""The nuisance that an effect of the measurement stands for, freed of its prior."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from escalator_twin.causes.imperfections import creep_shape
from escalator_twin.causes.registry import KNOWN
from escalator_twin.diagnosis.context import Beside
from escalator_twin.diagnosis.loops import LOCAL
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.stage import Stage

FREED = 100.0  # by how much a nuisance's prior is widened once it is an effect


def of_machine(proposal: Proposal) -> bool:
    """Tell whether a proposal is of the machine, and not of its measurement."""
    return KNOWN[proposal.cause].of_machine


def any_local(effects: Iterable[Proposal]) -> bool:
    """Tell whether an effect is one link's, axle's or step's, or a wave of the drive: runs then take the whole length."""
    return any(effect.cause in LOCAL for effect in effects)


def freed(place: Beside, effects: Sequence[Proposal]) -> Beside:
    """Return the comparison with the nuisance that an effect of the measurement stands for free.

    The tolerance that an effect of the machine stands for stays as it is: the effect is its size.
    """
    stage = place.stage

    def extra(effect: Proposal) -> np.ndarray:
        white: np.ndarray = stage.whiten(creep(stage, effect)[:, :, None])
        return white

    names, columns = _widened(stage.nuisance.names, stage.white_nuisance, effects, extra)
    stage = replace(stage, nuisance=replace(stage.nuisance, names=names), white_nuisance=columns)
    return replace(place, stage=stage, fitted=stage.fit(place.model))


def _widened(
    names: tuple[str, ...],
    columns: np.ndarray,
    effects: Sequence[Proposal],
    extra: Callable[[Proposal], np.ndarray],
) -> tuple[tuple[str, ...], np.ndarray]:
    """Return nuisance with room for effects of the measurement, one column a name on the last axis.

    A creep's shape is none of a good gauge's: it gets a column of its own, which ``extra`` gives.
    """
    columns = columns.copy()
    for effect in effects:
        if of_machine(effect):
            continue
        if effect.cause == 'gauge_drift':
            columns = np.concatenate([columns, extra(effect) * np.float32(FREED)], axis=-1)
            names = (*names, f'effect/{len(names)}')
            continue
        for k, name in enumerate(names):
            if effect.nuisance is not None and name.startswith(effect.nuisance):
                columns[..., k] *= np.float32(FREED)
    return names, columns


def without_own(stage: Stage, effects: Sequence[Proposal]) -> Stage:
    """Return the stage without the tolerances that effects of the machine, or a creep, stand for.

    Left in, such a tolerance would take an effect's place on both sides of the comparison: its prior
    hardly resists. A machine within tolerance has it where the tuning left it, within its bounds.
    """
    own = {e.nuisance for e in effects if of_machine(e)}
    creeps = tuple(str(e.nuisance) for e in effects if e.cause == 'gauge_drift')
    names = stage.nuisance.names
    keep = [k for k, name in enumerate(names) if name not in own and not name.startswith(creeps)]
    if len(keep) == len(names):
        return stage
    columns = stage.nuisance.columns
    # a gauge's creep has a name and a whitened column alone, behind all others
    own_columns = [k for k in keep if k < columns.shape[2]]
    # what `known_of_measurement` makes room for has a name and a column, and none that is whitened
    white = [k for k in keep if k < stage.white_nuisance.shape[1]]
    left = tuple(names[k] for k in keep)
    nuisance = replace(stage.nuisance, names=left, columns=columns[:, :, own_columns])
    return replace(stage, nuisance=nuisance, white_nuisance=stage.white_nuisance[:, white])


def known_of_measurement(stage: Stage, effects: Sequence[Proposal]) -> Stage:
    """Return the stage whose nuisance columns have room for effects of the measurement, see `freed`.

    Its whitened columns stay as they are: what is compared on parts of a recording is whitened there.
    """
    nuisance = stage.nuisance
    names, columns = _widened(
        nuisance.names, nuisance.columns, effects, lambda e: creep(stage, e)[:, :, None]
    )
    return replace(stage, nuisance=replace(nuisance, names=names, columns=columns))


def creep(stage: Stage, effect: Proposal) -> np.ndarray:
    """Return the creep of a link's gauges over the recording by its strain, (n, c)."""
    whole = np.zeros(stage.observation.measured.shape, np.float32)
    for k, channel in enumerate(stage.observation.channels):
        sensor = stage.machine.instruments.sensor(channel)
        if sensor.name == effect.location.get('link'):
            part = np.linspace(0.0, 1.0, len(whole))
            shape = creep_shape(part, effect.parameters['curvature'])
            whole[:, k] = sensor.scale * sensor.sign * shape * effect.parameters['strain']
    return whole
