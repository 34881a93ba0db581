"""Causes without a place: carriage, chain, drive and landing as wholes."""

from collections.abc import Iterator

import numpy as np

from escalator_twin.causes.registry import CAUSES
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.regression import (
    score_each,
    Scores,
)
from escalator_twin.diagnosis.search import from_softening, Search, SIDES
from escalator_twin.machine import Machine

FAR_START = 0.6  # of a far change, in its logarithm: where its simulation begins

# Causes whose response is that of a tolerance: knob and how its size turns into the parameter.
LIKE_KNOBS: dict[str, tuple[str, str]] = {
    'tensioner_stiffness': ('tensioner.stiffness_n_m', 'factor'),
    'tensioner_preload': ('experiment.preload_n', 'factor'),
    'rolling_resistance': ('roller.rolling_resistance', 'factor'),
    'drive_stiffness': ('drive.stiffness_n_m', 'factor'),
    'landing_length': ('guide.upper_landing_m', 'delta_m'),
}


def knob_place(cause: str) -> dict[str, object]:
    """Return where a cause sits whose response is that of a tolerance."""
    return {'which': 'upper'} if cause == 'landing_length' else {}


def whole(search: Search) -> Iterator[Proposal]:
    """Propose causes without an index: carriage friction, load offset, chain elongation."""
    found = search.view.responses.whole
    if 'tensioner_friction' in found:
        column = search.view.at(found['tensioner_friction'])[:, :, None]
        score = score_each(search.fitted, search.whiten(column))
        size, sd, gain = score.size[0], score.sd[0], score.gain[0]
        yield Proposal(
            'tensioner_friction', {}, {'force_N': max(size, 0.0)}, gain * (size > 0.0),
            {'force_N': sd}, fitted=('force_N',),
        )  # fmt: skip
    if 'load_offset' in found:
        column = search.view.at(found['load_offset'])[:, :, None]
        score = score_each(search.fitted, search.whiten(column))
        share = float(np.clip(0.5 + score.size[0], 0.0, 1.0))
        yield Proposal(
            'load_offset', {}, {'left_share': share}, score.gain[0],
            {'left_share': score.sd[0]}, fitted=('left_share',),
        )  # fmt: skip
    if 'chain_elongation' in found:
        left = search.view.at(found['chain_elongation'])
        right = search.view.at(found['chain_elongation'], mirrored=True)
        columns = np.stack([left, right, left + right], axis=2)
        score = score_each(search.fitted, search.whiten(columns))
        for k, side in enumerate((*SIDES, 'both')):
            yield Proposal(
                'chain_elongation', {'side': side}, {'length_m': score.size[k]}, score.gain[k],
                {'length_m': score.sd[k]}, 3, ('length_m',),
            )  # fmt: skip


def tolerances(search: Search) -> Iterator[Proposal]:
    """Propose causes that are a tolerance used up far beyond its size."""
    for cause, (knob, parameter) in LIKE_KNOBS.items():
        if knob not in search.names:
            continue
        k = search.names.index(knob)
        column = search.fitted.columns[:, k : k + 1]
        score = score_each(search.fitted.without(k), column)
        tolerance = tolerance_of(cause, parameter, search.machine, knob)
        size, sd = tolerance * score.size[0], tolerance * score.sd[0]
        neutral = 1.0 if parameter == 'factor' else 0.0
        value = neutral + size
        if cause == 'drive_stiffness' and size < 0.0:
            value = from_softening(-size)
        if parameter == 'factor':
            value = max(value, 0.1)
        yield Proposal(
            cause, knob_place(cause), {parameter: value}, beyond(score), {parameter: sd},
            fitted=(parameter,), nuisance=knob,
        )  # fmt: skip


def far(search: Search) -> Iterator[Proposal]:
    """Propose springs that are far from their tolerance, by what such a change does."""
    for (cause, parameter, reference), change in search.view.responses.far.items():
        knob = LIKE_KNOBS[cause][0]
        if knob not in search.names:
            continue
        k = search.names.index(knob)
        column = search.whiten(search.view.at(change)[:, :, None])
        score = score_each(search.fitted.without(k), column)
        part = float(np.clip(score.size[0], 0.0, 1.4))
        gain = (2.0 * score.size[0] * part - part**2) / score.sd[0] ** 2
        start = max(part, FAR_START)
        value = float(reference**start) if parameter == 'factor' else reference * start
        yield Proposal(
            cause, knob_place(cause), {parameter: value}, gain,
            {parameter: abs(value) * float(score.sd[0])},
            fitted=(parameter,), nuisance=knob,
        )  # fmt: skip


def stops(search: Search) -> Iterator[Proposal]:
    """Propose a stop of the carriage."""
    for level, change in search.view.responses.stops.items():
        score = score_each(search.fitted, search.whiten(search.view.at(change)[:, :, None]))
        size = float(np.clip(score.size[0], 0.0, 1.5))
        gain = (2.0 * score.size[0] * size - size * size) / score.sd[0] ** 2
        yield Proposal(
            'tensioner_stop', {}, {'displacement_m': level}, gain, {'displacement_m': 1e-4},
            1, ('displacement_m',),
        )  # fmt: skip


def beyond(score: Scores) -> float:
    """Return by how much chi squared falls where a tolerance's prior is lifted."""
    return float(score.size[0] ** 2 / (1.0 + score.sd[0] ** 2))


def tolerance_of(cause: str, parameter: str, machine: Machine, knob: str) -> float:
    """Return one standard deviation of a tolerance in the unit of a cause's parameter."""
    if knob in machine.tolerances:
        return machine.tolerances[knob]
    if knob == 'experiment.preload_n':
        return machine.tensioner.preload_tol
    if knob.startswith('guide.'):
        return machine.guide.landing_tol_m
    tolerance = next(p.tolerance for p in CAUSES[cause].parameters if p.name == parameter)
    return tolerance or 1.0
