"""Rollers whose tread is not round: eccentric ones, and flat spots."""

from collections.abc import Iterator
from math import atan2, hypot, pi

import numpy as np

from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.regression import (
    score_each,
    score_groups,
)
from escalator_twin.diagnosis.responses import find_flats, FLAT_PHASES
from escalator_twin.diagnosis.search import best, KEEP, Search, SIDES, wrapped

FLAT_WORTH = 10.0  # chi squared by the first order from which flat spots are looked at
SLIPS = np.linspace(-1e-3, 1e-3, 9)  # a quarter of a turn in a loop of the prototype is 2.5e-3
FLAT_GRID = 36


def eccentric(search: Search) -> Iterator[Proposal]:
    """Propose rollers whose tread is eccentric."""
    view = search.view
    columns, keys = [], []
    for side in (False, True):
        for axle in range(view.n_links):
            seen = view.turning(view.responses.eccentric, axle, side)
            columns += [seen.real, -seen.imag]
            keys.append((axle, SIDES[side]))
    sizes, gains = score_groups(search.fitted, search.whiten(np.stack(columns, axis=2)), 2)
    for k in np.argsort(-gains)[:KEEP]:
        axle, name = keys[k]
        amplitude = hypot(*sizes[k])
        # a sin(turn + phase) is the real part of a exp(i (turn + phase - pi/2))
        phase = atan2(sizes[k, 1], sizes[k, 0]) + 0.5 * pi + view.turn_at_start(axle)
        yield Proposal(
            'roller_eccentricity', {'axle': axle, 'side': name},
            {'amplitude_m': amplitude, 'phase_rad': wrapped(phase), 'slip': 0.0}, float(gains[k]),
            {'amplitude_m': amplitude / max(gains[k], 1e-9) ** 0.5}, 2 * view.n_links,
            ('amplitude_m', 'phase_rad', 'slip'),
        )  # fmt: skip


def flats(search: Search) -> Iterator[Proposal]:
    """Propose rollers with a flat spot: first by low orders, then by the spot's angle."""
    view = search.view
    n = view.n_links
    # at the first order a flat spot is an eccentricity: where there is none, there is no spot
    turning = [p for p in eccentric(search) if p.gain > FLAT_WORTH]
    if not turning or not search.is_open:
        return
    found = find_flats(
        search.machine, search.stage.setting.experiment, view.responses, search.jobs
    )
    orders = np.fft.fft(found, axis=0) / FLAT_PHASES  # of exp(i h phase)
    proposals = []
    highest = FLAT_PHASES // 2 - 1
    for proposal in turning:
        axle, side = proposal.location['axle'], proposal.location['side'] == 'right'
        assert isinstance(axle, int)
        grid = 2.0 * pi * np.arange(FLAT_GRID) / FLAT_GRID
        seen = [
            view.turning(orders[order].astype(np.complex64), axle, side, order)
            for order in range(1, highest + 1)
        ]
        turned = view.direction * view.observation.travel_m / view.responses.radius_m
        slipping = []
        for slip in SLIPS:
            total = np.repeat(view.at(orders[0].real, axle, side)[:, :, None], FLAT_GRID, axis=2)
            for order, wave in enumerate(seen, 1):
                late = np.exp(1j * order * slip * turned).astype(np.complex64)
                turn = np.exp(1j * order * grid).astype(np.complex64)
                total = total + 2.0 * ((wave * late[:, None])[:, :, None] * turn).real
            score = score_each(search.fitted, search.whiten(total))
            good = np.where(score.size > 0.0, score.gain, 0.0)
            top = int(np.argmax(good))
            phase = grid[top] + view.turn_at_start(axle)
            slipping.append(
                Proposal(
                    'roller_flat',
                    {'axle': axle, 'side': SIDES[side]},
                    {
                        'depth_m': float(max(score.size[top], 0.0)),
                        'phase_rad': wrapped(phase),
                        'slip': float(slip),
                    },
                    float(good[top]),
                    {'depth_m': float(score.sd[top])},
                    2 * n * FLAT_GRID // 3,
                    ('depth_m', 'phase_rad', 'slip'),
                )
            )
        proposals += best(slipping, 1)
    yield from best(proposals, 3)
