"""Search all causes and places by their linear responses."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import atan2, hypot, pi

import numpy as np

from escalator_twin.causes.registry import CAUSES
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.regression import (
    Fitted,
    inner_products,
    score_each,
    score_groups,
    Scores,
)
from escalator_twin.diagnosis.responses import find_flats, FLAT_PHASES
from escalator_twin.diagnosis.stage import Stage
from escalator_twin.diagnosis.view import View
from escalator_twin.diagnosis.whitening import Whitener
from escalator_twin.machine import Machine
from escalator_twin.signals import Floats

SIDES = ('left', 'right')
KEEP = 4  # places of one cause that go on to be simulated
DRAG_CELL_M = 0.25  # of the guide: the bar for a stretch's ends is 0.5 m
LONGEST_RUN = 8  # neighbouring steps with another load
FLAT_WORTH = 10.0  # chi squared by the first order from which flat spots are looked at
FLAT_GRID = 36
FAR_START = 0.6  # of a far change, in its logarithm: where its simulation begins

# Causes whose response is that of a tolerance: knob and how its size turns into the parameter.
LIKE_KNOBS: dict[str, tuple[str, str]] = {
    'tensioner_stiffness': ('tensioner.stiffness_n_m', 'factor'),
    'tensioner_preload': ('experiment.preload_n', 'factor'),
    'rolling_resistance': ('roller.rolling_resistance', 'factor'),
    'drive_stiffness': ('drive.stiffness_n_m', 'factor'),
    'landing_length': ('guide.upper_landing_m', 'delta_m'),
}


@dataclass(frozen=True)
class Search:
    """All that a family of causes needs to look for itself.

    Attributes
    ----------
    view : View
    fitted : Fitted
        The residual with its nuisance.
    stage : Stage
    model : (n, c) float64
        The stage's model, of which the residual is.
    jobs : int
        Simulations at a time.
    """

    view: View
    fitted: Fitted
    stage: Stage
    model: Floats
    jobs: int = 1

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the nuisance."""
        return self.stage.nuisance.names

    @property
    def machine(self) -> Machine:
        """The machine as known so far."""
        return self.stage.machine

    @property
    def whiten(self) -> Whitener:
        """What weighs the signals."""
        return self.stage.whiten


Family = Callable[[Search], Iterator[Proposal]]


def best(proposals: list[Proposal], count: int = KEEP) -> list[Proposal]:
    """Return the proposals that explain most."""
    return sorted(proposals, key=lambda p: -p.gain)[:count]


def from_softening(size: float) -> float:
    """Return the stiffness factor of an added compliance, relative to the own one."""
    return 1.0 / max(1.0 + size, 0.05)


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
        location: dict[str, object] = {'which': 'upper'} if cause == 'landing_length' else {}
        yield Proposal(
            cause, location, {parameter: value}, beyond(score), {parameter: sd},
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
        location: dict[str, object] = {'which': 'upper'} if cause == 'landing_length' else {}
        yield Proposal(
            cause, location, {parameter: value}, gain,
            {parameter: abs(value) * float(score.sd[0])},
            fitted=(parameter,), nuisance=knob,
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


def _improved(start: Proposal, right: Floats, gram: Floats, n: int) -> Proposal:
    """Add or drop single steps while chi squared falls by more than choosing them costs."""
    steps = start.location['steps']
    assert isinstance(steps, list)
    current, places = start, start.places
    worth = 2.0 * np.log(n) + 4.0
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
    length = abs(view.responses.base.rolled_m)
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
                )
            )
    yield from best(proposals, 2)


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
            {'amplitude_m': amplitude, 'phase_rad': wrapped(phase)}, float(gains[k]),
            {'amplitude_m': amplitude / max(gains[k], 1e-9) ** 0.5}, 2 * view.n_links,
            ('amplitude_m', 'phase_rad'),
        )  # fmt: skip


def wrapped(angle: float) -> float:
    """Return an angle between -pi and pi."""
    return float((angle + pi) % (2.0 * pi) - pi)


def flats(search: Search) -> Iterator[Proposal]:
    """Propose rollers with a flat spot: first by low orders, then by the spot's angle."""
    view = search.view
    n = view.n_links
    # at the first order a flat spot is an eccentricity: where there is none, there is no spot
    turning = [p for p in eccentric(search) if p.gain > FLAT_WORTH]
    if not turning:
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
        total = np.repeat(view.at(orders[0].real, axle, side)[:, :, None], FLAT_GRID, axis=2)
        for order in range(1, highest + 1):
            seen = view.turning(orders[order].astype(np.complex64), axle, side, order)
            turn = np.exp(1j * order * grid).astype(np.complex64)
            total = total + 2.0 * (seen[:, :, None] * turn).real
        score = score_each(search.fitted, search.whiten(total))
        good = np.where(score.size > 0.0, score.gain, 0.0)
        top = int(np.argmax(good))
        phase = grid[top] + view.turn_at_start(axle)
        proposals.append(
            Proposal(
                'roller_flat',
                {'axle': axle, 'side': SIDES[side]},
                {'depth_m': float(max(score.size[top], 0.0)), 'phase_rad': wrapped(phase)},
                float(good[top]),
                {'depth_m': float(score.sd[top])},
                2 * n * FLAT_GRID // 3,
                ('depth_m', 'phase_rad'),
            )
        )
    yield from best(proposals, 3)


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


def gains(search: Search) -> Iterator[Proposal]:
    """Propose a gauge's gain and its creep, and the accelerometer's rotation."""
    machine, names = search.machine, search.names
    part = np.linspace(0.0, 1.0, len(search.model))
    for k, channel in enumerate(search.view.observation.channels):
        sensor = machine.instruments.sensor(channel)
        if f'{channel}/gain' in names:
            at = names.index(f'{channel}/gain')
            score = score_each(search.fitted.without(at), search.fitted.columns[:, at : at + 1])
            factor = 1.0 + sensor.gain_tol * float(score.size[0])
            yield Proposal(
                'gauge_gain', {'link': sensor.name}, {'factor': factor}, beyond(score),
                {'factor': sensor.gain_tol * float(score.sd[0])}, 4, ('factor',),
                f'{channel}/gain',
            )  # fmt: skip
        if sensor.thermal_drift > 0.0:
            columns = np.zeros((*search.model.shape, len(CURVATURES)), np.float32)
            for j, c in enumerate(CURVATURES):
                creep = part if c == 0.0 else (1.0 - np.exp(-c * part)) / (1.0 - np.exp(-c))
                columns[:, k, j] = sensor.scale * sensor.sign * creep
            score = score_each(search.fitted, search.whiten(columns))
            top = int(np.argmax(score.gain))
            yield Proposal(
                'gauge_drift', {'link': sensor.name},
                {'strain': float(score.size[top]), 'curvature': CURVATURES[top]},
                float(score.gain[top]), {'strain': float(score.sd[top])}, 4, ('strain',),
            )  # fmt: skip
    turned = [names.index(f'rotation/{a}') for a in 'xyz' if f'rotation/{a}' in names]
    if len(turned) == 3:
        tolerance = max(s.rotation_tol_deg for s in machine.instruments.sensors)
        rest = search.fitted
        for at in reversed(turned):
            rest = rest.without(at)
        sizes, _ = score_groups(rest, search.fitted.columns[:, turned], 3)
        _, gram = inner_products(rest, search.fitted.columns[:, turned])
        spread = np.eye(3) + np.linalg.inv(gram)
        gain = float(sizes[0] @ np.linalg.solve(spread, sizes[0]))
        degrees = {f'{a}_deg': float(tolerance * sizes[0, i]) for i, a in enumerate('xyz')}
        yield Proposal(
            'accelerometer_misalignment', {}, degrees, gain, {},
            1, tuple(degrees), 'rotation',
        )  # fmt: skip


CURVATURES = (0.0, 1.0, 2.0, 4.0, 8.0)
FAMILIES: tuple[Family, ...] = (
    whole, tolerances, far, indexed, loads, drags, eccentric, flats, stops, gains,
)  # fmt: skip


def search_all(search: Search, families: tuple[Family, ...] = FAMILIES) -> list[Proposal]:
    """Return what all families propose, best first."""
    found = [proposal for family in families for proposal in family(search)]
    return sorted(found, key=lambda p: -p.gain)
