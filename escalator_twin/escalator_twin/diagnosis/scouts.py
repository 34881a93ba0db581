"""Which recordings of a campaign are searched in full, and what the others begin with."""

from collections.abc import Sequence
from math import log

import numpy as np

from escalator_twin.diagnosis.campaign import pooled, union_of
from escalator_twin.diagnosis.diagnose import Diagnosis
from escalator_twin.diagnosis.free import of_machine
from escalator_twin.diagnosis.phases import ROUND
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.signals import Experiment

SCOUTS = 4
FIRST = 2  # of them search with nothing suggested


def choose_scouts(experiments: Sequence[Experiment | None], most: int = SCOUTS) -> list[int]:
    """Return the recordings whose experiments differ most, the fastest and fullest first.

    Each next one is as different as can be from those before.
    """
    if len(experiments) <= most:
        return list(range(len(experiments)))
    rows = np.array([_coordinates(e) for e in experiments])
    spread = rows.max(axis=0) - rows.min(axis=0)
    rows = (rows - rows.min(axis=0)) / np.where(spread > 0.0, spread, 1.0)
    # fast, full and slack first: there the chain moves most
    chosen = [int(np.argmax(rows @ np.array([1.0, 0.1, 1.0, -0.5])))]
    while len(chosen) < most:
        away = np.abs(rows[:, None, :] - rows[chosen][None, :, :]).sum(axis=2).min(axis=1)
        away[chosen] = -1.0
        chosen.append(int(np.argmax(away)))
    return chosen


def shared_by(scouts: Sequence[Diagnosis]) -> list[Proposal]:
    """Return the effects of the machine that all scouts so far name, with their joint numbers.

    Those of one frequency or angle stay out: each recording has its own phase. That of an eccentric roller
    two runs tell (`rolled_here`).
    """
    return [
        pooled([(f.proposal, f.sd) for f, _ in group]).proposal
        for group in union_of(scouts)
        if len(group) == len(scouts) and may_begin_with(group[0][0].proposal)
    ]


def may_begin_with(effect: Proposal) -> bool:
    """Tell whether a search may begin with an effect that another recording named."""
    if not of_machine(effect) or not effect.fitted:
        return False
    return effect.cause == ROUND or 'phase_rad' not in effect.parameters


def _coordinates(experiment: Experiment | None) -> list[float]:
    if experiment is None:
        return [0.0] * 4
    return [
        log(max(experiment.set_speed_m_s, 1e-3)),
        float(experiment.direction),
        float(np.mean(experiment.load_per_step_kg)),
        experiment.preload_n,
    ]
