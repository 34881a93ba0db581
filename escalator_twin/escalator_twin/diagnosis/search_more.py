"""Causes that need a run of their own before they can be looked for: rail, drive and frame."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import atan2, pi

import numpy as np
from scipy import fft
from scipy.interpolate import CubicSpline

from escalator_twin.causes.application import apply
from escalator_twin.causes.guide_step import LENGTH_M
from escalator_twin.comparison.locate import RATE_HZ
from escalator_twin.diagnosis.knobs import turn_all
from escalator_twin.diagnosis.loops import BAND_HZ, band_limited
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.regression import score_each, score_groups
from escalator_twin.diagnosis.search import Search, SIDES, wrapped
from escalator_twin.errors import EscalatorError
from escalator_twin.machine import Deviation
from escalator_twin.physics import run
from escalator_twin.physics.periodic import between
from escalator_twin.signals import Floats
from escalator_twin.twin import make_simulation

RAIL_STEP_M = 0.02
RAIL_WORTH = 2.5  # chi squared by the step's own acceleration from which a place is simulated
RAIL_TRIES = 2
RAIL_APART_M = 0.3  # of two places
RAIL_SHIFTS_M = (0.0, -0.03, 0.03)  # what the step's own acceleration leaves open
RAIL_LEAST = 5.0  # chi squared there, below which no shift is tried
RAIL_OPEN = 50.0  # from which more shapes are tried: noise, and a survey's error, are far below
# The shapes of contracts.md, a centimetre of length apart: a roller leaves a longer bump otherwise.
RAIL_LENGTHS_M = (0.045, 0.055, 0.065, 0.075)
RAIL_NEAR_M = (0.0, -0.02, 0.02)
RAIL_CLOSE = 0.5  # of the best place's, from which another's shapes are tried as well
TRIAL_M = 1.5e-3
RAIL_HEIGHTS_M = (TRIAL_M, -TRIAL_M, TRIAL_M / 3.0, -TRIAL_M / 3.0)
CHUNK = 128
SLOWEST_HZ, ALL_CHANNELS_HZ, FASTEST_HZ = 0.08, 1.0, 10.0
FRAME_HZ = (2.5, 16.0)
FRAME_RATIO = 1.012
FRAME_DAMPING = (0.01, 0.02, 0.04)
FRAME_MASS_KG = 1e6  # of a frame so heavy that it stands still


def rail_steps(search: Search) -> Iterator[Proposal]:
    """Propose steps of the rail: first by the step's own acceleration, then by a run."""
    observation, view = search.view.observation, search.view
    at = [
        k
        for k, channel in enumerate(observation.channels)
        if search.machine.instruments.sensor(channel).at.get('axis') == 'z'
    ]
    if not at:
        return
    length = abs(view.responses.base.length_m)
    places = np.arange(0.0, length, RAIL_STEP_M)
    score, gains = np.zeros(len(places)), np.zeros(len(places))
    for start in range(0, len(places), CHUNK):
        some = places[start : start + CHUNK]
        columns = np.zeros((*search.model.shape, len(some)), np.float32)
        for axle in (0, 1):
            columns[:, at[0]] += _bumps(search, axle, some, length)
        found = score_each(search.fitted, search.whiten(columns))
        gains[start : start + CHUNK] = found.gain
        score[start : start + CHUNK] = found.size
    starts: list[float] = []
    for k in np.argsort(-gains):
        if len(starts) == RAIL_TRIES or gains[k] < RAIL_WORTH:
            break
        if any(_apart(places[k], s, length) < RAIL_APART_M for s in starts):
            continue
        starts.append(float(places[k]))
    # a step's two axles pass a bump one after the other: one pitch further it looks half as well
    pitch = observation.frame.pitch_m
    for start in starts[:1]:
        beside = [float((start + way) % length) for way in (-pitch, pitch)]
        starts += [s for s in beside if all(_apart(s, k, length) > RAIL_APART_M / 2 for k in starts)]
    trials = [_rail_trial(search, s, float(np.sign(score[round(s / RAIL_STEP_M) % len(places)]))) for s in starts]
    trials.sort(key=lambda found: -_most(found).gain)
    for found in trials:
        if _most(found).gain >= max(RAIL_OPEN, RAIL_CLOSE * _most(trials[0]).gain):
            found += _rail_shapes(search, found)
    trials.sort(key=lambda found: -_most(found).gain)
    for found in trials[:RAIL_TRIES]:
        for side in (*SIDES, 'both'):
            yield _most([p for p in found if p.location['side'] == side])


def _apart(one: float, other: float, length: float) -> float:
    """Return the distance of two places round the loop, m."""
    return abs((one - other + 0.5 * length) % length - 0.5 * length)


def _most(found: Sequence[Proposal]) -> Proposal:
    return max(found, key=lambda p: p.gain)


def _bumps(search: Search, axle: int, places: Floats, length: float) -> np.ndarray:
    """Return the acceleration of a step by bumps of 1 m under one roller, (n, k)."""
    frame = search.view.observation.frame
    way = search.view.place_of(axle)
    away = (way[:, None] - places[None, :] + 0.5 * length) % length - 0.5 * length
    inside = np.abs(away) < 0.5 * LENGTH_M
    wave = 2.0 * pi / LENGTH_M
    # h'' v^2, a quarter of it: one roller of four carries the middle of the step
    bend = -0.5 * wave**2 * np.cos(wave * away) * np.where(inside, 1.0, 0.0)
    raw = 0.25 * frame.speed_m_s**2 * bend
    limited: np.ndarray = band_limited(raw, frame.rate_hz).astype(np.float32)
    return limited


def _rail_trial(search: Search, place: float, sign: float) -> list[Proposal]:
    """Run bumps at a place and beside it on the left; the right side is their mirror image."""
    length = abs(search.view.responses.base.length_m)
    found: list[Proposal] = []
    for shift in RAIL_SHIFTS_M:
        if found and _most(found).gain < RAIL_LEAST:
            break
        found += _bumped(search, float((place + shift) % length), sign * TRIAL_M, LENGTH_M)
    return found


def _rail_shapes(search: Search, known: Sequence[Proposal]) -> list[Proposal]:
    """Run bumps of many shapes at a place where one explains something.

    What a bump does is linear in its height only as long as the rollers stay on their track.
    """
    length = abs(search.view.responses.base.length_m)
    middle = float(str(known[0].location['s_m']))
    found: list[Proposal] = []
    for shift in RAIL_NEAR_M:
        for wide in RAIL_LENGTHS_M:
            for height in RAIL_HEIGHTS_M:
                found += _bumped(search, float((middle + shift) % length), height, wide)
    return found


def _bumped(search: Search, at: float, height: float, wide: float) -> list[Proposal]:
    """Propose a bump of one shape at one place, on the left, on the right and on both sides."""
    count = 3 * round(abs(search.view.responses.base.length_m) / 0.25)
    location: dict[str, object] = {'s_m': at, 'side': 'left'}
    deviation = Deviation('guide_step', {'height_m': height, 'length_m': wide}, location)
    left = (search.stage.run((deviation,)) - search.model) / height
    right = mirrored(search, left)
    columns = np.stack([left, right, left + right], axis=2)
    score = score_each(search.fitted, search.whiten(columns))
    return [
        Proposal(
            'guide_step', {'s_m': at, 'side': side},
            {'height_m': float(score.size[k]), 'length_m': wide}, float(score.gain[k]),
            {'height_m': float(score.sd[k])}, count, ('height_m', '@s_m', 'length_m'),
        )
        for k, side in enumerate((*SIDES, 'both'))
    ]  # fmt: skip


def mirrored(search: Search, columns: Floats) -> Floats:
    """Return a response on the channels of the other side, (n, c)."""
    sensors = [
        search.machine.instruments.sensor(channel) for channel in search.view.observation.channels
    ]
    other = np.array(columns)
    for k, sensor in enumerate(sensors):
        if sensor.at.get('axis') == 'y':
            other[:, k] = -columns[:, k]
        if 'side' not in sensor.at:
            continue
        twin = {**sensor.at, 'side': SIDES[1 - SIDES.index(str(sensor.at['side']))]}
        for j, candidate in enumerate(sensors):
            if candidate.quantity == sensor.quantity and candidate.at == twin:
                other[:, k] = columns[:, j]
    return other


def drive_waves(search: Search) -> Iterator[Proposal]:
    """Propose a ripple or a hunting of the drive's speed by a frequency of the residual."""
    observation = search.view.observation
    frame = observation.frame
    seconds = observation.travel_m / frame.speed_m_s
    slope = CubicSpline(observation.travel_m, search.model)(observation.travel_m, 1)
    along = np.array(
        [
            search.machine.instruments.sensor(channel).at.get('axis') == 'x'
            for channel in observation.channels
        ],
        float,
    )
    spacing = 0.4 / (seconds[-1] - seconds[0])
    grid = np.arange(SLOWEST_HZ, FASTEST_HZ, spacing)
    gains, sizes = np.zeros(len(grid)), np.zeros((len(grid), 2))
    slow = int(np.searchsorted(grid, ALL_CHANNELS_HZ))
    for start in range(0, slow, CHUNK):
        some = grid[start : min(start + CHUNK, slow)]
        columns = np.empty((*search.model.shape, 2 * len(some)), np.float32)
        for k, f in enumerate(some):
            omega = 2.0 * pi * f
            for part, wave in enumerate((np.cos(omega * seconds), -np.sin(omega * seconds))):
                carried = slope * wave[:, None]
                columns[:, :, 2 * k + part] = carried - omega**2 * wave[:, None] * along
        rows = slice(start, start + len(some))
        sizes[rows], gains[rows] = score_groups(search.fitted, search.whiten(columns), 2)
    if along.any():
        sizes[slow:], gains[slow:] = _fast_waves(search, grid[slow:], seconds, int(along.argmax()))
    order: list[int] = []
    for k in np.argsort(-gains):
        if all(abs(int(k) - j) > 4 for j in order):
            order.append(int(k))
        if len(order) == 2:
            break
    for k in order:
        f, c = float(grid[k]), complex(*sizes[k])
        amplitude = abs(c) * 2.0 * pi * f / frame.speed_m_s
        phase = wrapped(atan2((-c).imag, (-c).real))
        size = {'relative_amplitude': float(min(amplitude, 0.3))}
        # a ripple is a wave of the rack's travel, which falls where the machine runs down
        in_travel = phase if search.stage.setting.experiment.direction > 0 else wrapped(pi - phase)
        if f >= 0.1:
            yield Proposal(
                'drive_hunting', {}, {**size, 'phase_rad': phase, 'frequency_hz': f},
                float(gains[k]), {},
                len(grid), ('relative_amplitude', 'frequency_hz', 'phase_rad'), draws=1,
            )  # fmt: skip
        turns = f * frame.pitch_m / frame.speed_m_s
        yield Proposal(
            'drive_ripple', {}, {**size, 'phase_rad': in_travel, 'cycles_per_pitch': turns},
            float(gains[k]), {},
            len(grid), ('relative_amplitude', 'cycles_per_pitch', 'phase_rad'), draws=1,
        )  # fmt: skip


def _fast_waves(
    search: Search, grid: Floats, seconds: Floats, channel: int
) -> tuple[Floats, Floats]:
    """Return sizes (k, 2) and gains (k,) of waves by the acceleration along the link alone.

    There a fast wave of travel stands out by the square of its frequency, and the nuisance, all
    of it slow or at multiples of the pitch, hardly takes part.
    """
    c = search.model.shape[1]
    weight = search.whiten.weight[:, channel : channel + 1]
    mask = search.whiten.mask[:, channel : channel + 1]
    alone = replace(search.whiten, mask=mask, weight=weight)
    left = search.fitted.left().reshape(-1, c)[:, channel]
    gains, sizes = np.zeros(len(grid)), np.zeros((len(grid), 2))
    for start in range(0, len(grid), CHUNK):
        some = 2.0 * pi * grid[start : start + CHUNK]
        angle = seconds[:, None] * some[None, :]
        columns = np.stack([-(some**2) * np.cos(angle), some**2 * np.sin(angle)], axis=2)
        white = alone(columns.reshape(len(seconds), 1, -1)).reshape(len(left), -1, 2)
        right = np.einsum('m,mkp->kp', left, white)
        gram = np.einsum('mkp,mkq->kpq', white, white)
        found = np.linalg.solve(gram, right[:, :, None])[:, :, 0]
        rows = slice(start, start + len(some))
        sizes[rows], gains[rows] = found, np.einsum('kp,kp->k', found, right)
    return sizes, gains


def frame_bounce(search: Search) -> Iterator[Proposal]:
    """Propose a frame that bounces: its answer to the force that a rigid one would carry."""
    observation = search.view.observation
    sensors = [search.machine.instruments.sensor(c) for c in observation.channels]
    axes = {str(s.at.get('axis')): k for k, s in enumerate(sensors) if s.at.get('axis')}
    if 'z' not in axes:
        return
    try:
        force, rate = _frame_force(search)
    except EscalatorError:
        return
    pull = np.zeros(search.model.shape)
    gravity = search.machine.gravity_m_s2
    for axis in ('x', 'z'):
        if axis in axes:
            pull[:, axes[axis]] = np.clip(search.model[:, axes[axis]] / gravity, -1.0, 1.0)
    where = observation.travel_m / observation.frame.speed_m_s * rate
    size = fft.next_fast_len(2 * len(force), real=True)
    spectrum = fft.rfft(force - force.mean(), size)
    omega = 2.0 * pi * np.fft.rfftfreq(size, 1.0 / rate)
    keep = 1.0 / (1.0 + (omega / (2.0 * pi * BAND_HZ)) ** 8)
    count = int(np.log(FRAME_HZ[1] / FRAME_HZ[0]) / np.log(FRAME_RATIO))
    options = [
        (FRAME_HZ[0] * FRAME_RATIO**k, damping) for k in range(count) for damping in FRAME_DAMPING
    ]
    best: list[tuple[float, float, float, float, float]] = []
    for start in range(0, len(options), CHUNK):
        some = options[start : start + CHUNK]
        columns = np.empty((*search.model.shape, len(some)), np.float32)
        for k, (f, damping) in enumerate(some):
            own = 2.0 * pi * f
            answer = -(omega**2) / (own**2 - omega**2 + 2j * damping * own * omega) * keep
            lift = fft.irfft(spectrum * answer, size)[: len(force)]
            columns[:, :, k] = pull * between(lift[:, None], where)
        score = score_each(search.fitted, search.whiten(columns))
        for k, (f, damping) in enumerate(some):
            if score.size[k] > 0.0:
                row = (float(score.gain[k]), f, damping, float(score.size[k]), float(score.sd[k]))
                best.append(row)
    if not best:
        return
    gain, f, damping, size_1, sd = max(best)
    mass = float(np.clip(1.0 / size_1, 10.0, 1e6))
    yield Proposal(
        'truss_resonance', {},
        {'modal_mass_kg': mass, 'frequency_hz': f, 'damping_ratio': damping}, gain,
        {'modal_mass_kg': mass * sd / size_1}, len(options),
        ('modal_mass_kg', 'frequency_hz', 'damping_ratio'),
    )  # fmt: skip


def _frame_force(search: Search) -> tuple[Floats, float]:
    """Return the vertical force on the frame over the run, N, and its rate, Hz."""
    stage = search.stage
    machine, experiment = turn_all(
        stage.machine, stage.setting.experiment, stage.knobs, stage.turned
    )
    heavy = Deviation(
        'truss_resonance',
        {'modal_mass_kg': FRAME_MASS_KG, 'frequency_hz': 0.5, 'damping_ratio': 0.5},
    )
    simulation = make_simulation(apply(machine, (heavy,)), experiment)
    simulation.start(stage.setting.start_s_m)
    probes = np.array([(run.FRAME, 0, 0)], dtype=np.int64)
    record = simulation.advance(stage.setting.duration_s, RATE_HZ, probes)
    return record[:, 0], RATE_HZ
