"""Rollers whose tread is not round: eccentric ones, and flat spots."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from math import atan2, ceil, hypot, pi

import numpy as np
from scipy import fft

from escalator_twin.diagnosis.knobs import turn_all
from escalator_twin.diagnosis.large_effects import find_flats
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.regression import inner_products, score_groups
from escalator_twin.diagnosis.responses import at_sensors
from escalator_twin.diagnosis.search import best, KEEP, Search, SIDES, wrapped
from escalator_twin.signals import Floats

FLAT_WORTH = 10.0  # chi squared by the first order from which flat spots are looked at
# Times what its first order explains, the least and the most that a spot does: 172, 129, 120 and 42 at 0.25 m/s, 86 and 37
# at 0.5 m/s in the recordings of seeds 60214 and 131101 to 181101 with a spot.
FLAT_LEAST, FLAT_MOST = 10.0, 300.0
SLIP = 1e-3  # at most; a quarter of a turn in a loop of the prototype is 2.5e-3
IN_STEP_RAD = 0.7  # by which the highest order may be late at the ends
FLAT_GRID = 180  # phases: a sixth of the highest order's wave or less


def eccentric(search: Search) -> Iterator[Proposal]:
    """Propose rollers whose tread is eccentric."""
    view = search.view
    rolled = view.responses.rolled_m
    if rolled is None:
        return
    before = search.stage.rolled_at_start()
    columns, keys = [], []
    for side in (False, True):
        for axle in range(view.n_links):
            seen = view.turning(view.responses.eccentric, rolled, axle, side)
            columns += [seen.real, -seen.imag]
            keys.append((axle, SIDES[side]))
    sizes, gains = score_groups(search.fitted, search.whiten(np.stack(columns, axis=2)), 2)
    for k in np.argsort(-gains)[:KEEP]:
        axle, name = keys[k]
        amplitude = hypot(*sizes[k])
        # a sin(turn + phase) is the real part of a exp(i (turn + phase - pi/2))
        phase = (
            atan2(sizes[k, 1], sizes[k, 0])
            + 0.5 * pi
            + view.turn_at_start(rolled, axle, before[axle])
        )
        yield Proposal(
            'roller_eccentricity', {'axle': axle, 'side': name},
            {'amplitude_m': amplitude, 'phase_rad': wrapped(phase), 'slip': 0.0}, float(gains[k]),
            {'amplitude_m': amplitude / max(gains[k], 1e-9) ** 0.5}, 2 * view.n_links,
            ('amplitude_m', 'phase_rad', 'slip'),
        )  # fmt: skip


def flats(search: Search) -> Iterator[Proposal]:
    """Propose rollers with a flat spot: first by low orders, then by the spot's angle."""
    # at the first order a flat spot is an eccentricity: where there is none, there is no spot
    least, most = max(FLAT_WORTH, search.least / FLAT_MOST), search.fitted.chi2 / FLAT_LEAST
    turning = [p for p in eccentric(search) if p.gain > least]
    if not turning or turning[0].gain > most or not search.is_open:
        return
    stage = search.stage
    machine, experiment = turn_all(
        search.machine, stage.setting.experiment, stage.knobs, stage.turned
    )
    found, rolled = find_flats(machine, experiment, search.view.responses, search.jobs)
    before = stage.rolled_at_start()
    with ThreadPoolExecutor(max(1, search.jobs)) as pool:
        spots = pool.map(lambda p: _spot(search, found, rolled, before, p), turning)
        yield from best([spot for spot in spots if spot.gain > 0.0], 3)


def unfolded(flats: np.ndarray, turned: Floats, count: int) -> np.ndarray:
    """Return what a spot does as a series of its phase, from fewer phases than orders.

    At a place of the loop a roller has turned by an angle that it shares with a spot of another phase elsewhere:
    what a spot at an angle does changes slowly from place to place. Phases fold an order onto others that are
    their number apart, whose waves along the loop are as far apart: each is taken where it lies.

    Parameters
    ----------
    flats : (phases, n_loop, c) float32
        At evenly spaced phases, of a whole turn.
    turned : (n_loop,) float64
        By the roller, rad, of either sense.
    count : int

    Returns
    -------
    orders : (count, n_loop, c) complex64
        Orders 0 to count - 1 per turn, of which the signals are the real part, twice those above 0.
    """
    phases, n, _ = flats.shape
    folded = fft.fft(flats, axis=0) / np.float32(phases)
    if phases >= 2 * count:
        return np.asarray(folded[:count])
    per_turn = 2.0 * pi * (n - 1) / abs(turned[-1] - turned[0])
    away = np.abs(fft.fftfreq(n)) * per_turn / phases  # of the distance of two orders in one
    # one half way between two; what is 1/8 on either side goes over smoothly
    share = 0.5 - 0.5 * np.cos(pi * np.clip((0.625 - away) / 0.25, 0.0, 1.0))
    orders = np.empty((count, *flats.shape[1:]), np.complex64)
    for order in range(count):
        carrier = np.exp(1j * order * turned)[:, None]
        slow = fft.fft(folded[order % phases] * carrier.conj(), axis=0) * share[:, None]
        orders[order] = fft.ifft(slow, axis=0) * carrier
    return orders


def _spot(
    search: Search, flats: np.ndarray, rolled_m: Floats, before_m: Floats, like: Proposal
) -> Proposal:
    """Return the flat spot that explains most on a roller that may be eccentric.

    Parameters
    ----------
    search : Search
    flats : (phases, n_loop, 1 + 5 n) float32
        What a spot does, see `find_flats`.
    rolled_m : (n_loop + 1,) float64
        Of axle 0 in the runs behind that.
    before_m : (n_links,) float64
        Of all axles, see `Stage.rolled_at_start`.
    like : Proposal
        Of that roller.
    """
    view = search.view
    axle, side = like.location['axle'], like.location['side'] == SIDES[1]
    assert isinstance(axle, int)
    frame, radius = view.observation.frame, view.responses.radius_m
    picked = at_sensors(flats, view.probes, view.n_links, axle, side)
    # as many as the grid has points in half a turn
    orders = unfolded(picked, rolled_m[:-1] / radius, ceil(pi * radius / frame.spacing_m))
    waves = np.stack(
        [view.rolling(wave, rolled_m, axle, order) for order, wave in enumerate(orders)], axis=2
    )
    waves[:, :, 1:] *= 2.0
    turned = view.direction * view.observation.travel_m / radius
    number = np.arange(len(orders))
    grid = 2.0 * pi * np.arange(FLAT_GRID) / FLAT_GRID
    series = np.exp(1j * grid[:, None] * number)
    # real and imaginary parts; of order 0 there is no imaginary one
    series = np.hstack([series.real, -series.imag[:, 1:]])
    # steps of slip small enough for the highest order to stay in step over half the recording
    half = 0.5 * float(np.ptp(turned))
    count = 2 * ceil(SLIP * half * len(orders) / IN_STEP_RAD) + 1
    spots = []
    for slip in np.linspace(-SLIP, SLIP, count):
        late = np.exp(1j * slip * turned[:, None] * number).astype(np.complex64)
        seen = waves * late[:, None]
        columns = np.concatenate([seen.real, seen.imag[:, :, 1:]], axis=2)
        right, gram = inner_products(search.fitted, search.whiten(columns))
        total = series @ right
        power = np.maximum(np.einsum('ij,jk,ik->i', series, gram, series), 1e-12)
        gain = np.where(total > 0.0, total**2 / power, 0.0)
        top = int(np.argmax(gain))
        sizes = (gain[top], slip, grid[top], total[top] / power[top], power[top])
        spots.append(tuple(float(size) for size in sizes))
    most, slip, phase, depth, weight = max(spots)
    return Proposal(
        'roller_flat',
        like.location,
        {
            'depth_m': depth,
            'phase_rad': wrapped(phase + view.turn_at_start(rolled_m, axle, before_m[axle])),
            'slip': slip,
        },
        most,
        {'depth_m': weight**-0.5},
        2 * view.n_links * 2 * len(orders),
        ('depth_m', 'phase_rad', 'slip'),
    )
