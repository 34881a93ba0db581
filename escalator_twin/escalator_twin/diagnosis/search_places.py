"""Causes at one link, axle or step, at some steps, or along a stretch of the guide."""

from collections.abc import Iterator

import numpy as np

from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.regression import (
    inner_products,
    score_each,
)
from escalator_twin.diagnosis.search import best, from_softening, KEEP, Search, SIDES
from escalator_twin.signals import Floats

DRAG_CELL_M = 0.25  # of the guide: the bar for a stretch's ends is 0.5 m
LONGEST_RUN = 8  # neighbouring steps with another load


def indexed(search: Search) -> Iterator[Proposal]:
    """Propose links, axles and steps."""
    found = search.view.responses.places
    n = search.view.n_links
    for cause, key, parameter, sided in (
        ('link_elongation', 'link', 'length_m', False),
        ('step_mass', 'step', 'delta_kg', False),
        ('link_stiffness', 'link', 'factor', True),
        ('roller_drag', 'axle', 'force_N', True),
    ):
        if cause not in found:
            continue
        sides = (False, True) if sided else (False,)
        white = search.whiten(search.view.each(found[cause], sides))
        score = score_each(search.fitted, white)
        proposals = []
        for k in np.argsort(-score.gain)[: 3 * KEEP]:
            size, sd = float(score.size[k]), float(score.sd[k])
            if cause == 'roller_drag' and size <= 0.0:
                continue
            location: dict[str, object] = {key: int(k % n)}
            if sided:
                location['side'] = SIDES[k // n]
            value = from_softening(size) if cause == 'link_stiffness' else size
            if cause == 'step_mass':
                value = max(value, -19.0)
            proposals.append(
                Proposal(
                    cause,
                    location,
                    {parameter: value},
                    float(score.gain[k]),
                    {parameter: sd},
                    n * len(sides),
                    (parameter,),
                )
            )
        yield from best(proposals)


def loads(search: Search) -> Iterator[Proposal]:
    """Propose runs of neighbouring steps with another load."""
    found = search.view.responses.places.get('load_distribution')
    if found is None:
        return
    n = search.view.n_links
    right, gram = inner_products(search.fitted, search.whiten(search.view.each(found)))
    proposals = []
    for count in range(1, LONGEST_RUN + 1):
        for first in range(n):
            steps = [(first + k) % n for k in range(count)]
            proposals.append(_loaded(right, gram, steps, n * LONGEST_RUN))
    chosen = best(proposals, KEEP)
    # single steps may stand apart from their neighbours: add and drop while it pays
    for proposal in chosen[:2]:
        yield _improved(proposal, right, gram, n)
    yield from chosen


def _loaded(right: Floats, gram: Floats, steps: list[int], places: int) -> Proposal:
    power = float(gram[np.ix_(steps, steps)].sum())
    total = float(right[steps].sum())
    size = total / power
    factor = float(np.clip(1.0 + size, 0.0, 20.0))
    size = factor - 1.0  # no less than no load
    gain = 2.0 * size * total - size * size * power
    return Proposal(
        'load_distribution', {'steps': sorted(steps)}, {'load_factor': factor}, gain,
        {'load_factor': power**-0.5}, places, ('load_factor',),
    )  # fmt: skip


def worth_a_step(n: int) -> float:
    """Return by how much chi squared must fall for one of n steps to be chosen."""
    return 2.0 * float(np.log(n)) + 4.0


def _improved(start: Proposal, right: Floats, gram: Floats, n: int) -> Proposal:
    """Add or drop single steps while chi squared falls by more than choosing them costs."""
    steps = start.location['steps']
    assert isinstance(steps, list)
    current, places = start, start.places
    worth = worth_a_step(n)
    for _ in range(n):
        options = [[s for s in steps if s != k] for k in steps if len(steps) > 1]
        options += [[*steps, k] for k in range(n) if k not in steps]
        trial = max((_loaded(right, gram, o, places * n) for o in options), key=lambda p: p.gain)
        now = trial.location['steps']
        assert isinstance(now, list)
        needed = worth if len(now) > len(steps) else -worth
        if trial.gain < current.gain + needed:
            break
        current, steps = trial, now
    return current


def drags(search: Search) -> Iterator[Proposal]:
    """Propose stretches of the guide with extra drag on every roller that passes."""
    found = search.view.responses.places.get('roller_drag')
    if found is None:
        return
    view = search.view
    length = abs(view.responses.base.length_m)
    count = int(np.ceil(length / DRAG_CELL_M))
    n, c = search.model.shape
    cells = np.zeros((count, n, c), np.float32)
    rows = np.arange(n)
    for axle in range(view.n_links):
        cell = np.minimum((view.place_of(axle) / DRAG_CELL_M).astype(int), count - 1)
        cells[cell, rows] += view.at(found, axle) + view.at(found, axle, True)
    right, gram = inner_products(search.fitted, search.whiten(np.moveaxis(cells, 0, 2)))
    sums = np.concatenate([[0.0], np.cumsum(right)])
    blocks = np.pad(np.cumsum(np.cumsum(gram, 0), 1), ((1, 0), (1, 0)))
    proposals = []
    for i in range(count):
        for k in range(i + 1, count + 1):
            total = sums[k] - sums[i]
            power = blocks[k, k] - blocks[i, k] - blocks[k, i] + blocks[i, i]
            if total <= 0.0:
                continue
            proposals.append(
                Proposal(
                    'guide_drag',
                    {'s_from_m': i * DRAG_CELL_M, 's_to_m': min(k * DRAG_CELL_M, length)},
                    {'force_N': total / power},
                    total**2 / power,
                    {'force_N': power**-0.5},
                    count * (count + 1) // 2,
                    ('force_N', '@s_from_m', '@s_to_m'),
                    draws=count,
                )
            )
    yield from best(proposals, 2)
