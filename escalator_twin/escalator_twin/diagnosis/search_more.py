"""Waves of the drive, and the frame's bounce, which needs a run of its own."""

from collections.abc import Iterator
from dataclasses import replace
from math import atan2, pi

import numpy as np
from scipy import fft

from escalator_twin.causes.application import apply
from escalator_twin.comparison.locate import RATE_HZ
from escalator_twin.diagnosis.grids import BAND_HZ
from escalator_twin.diagnosis.knobs import turn_all
from escalator_twin.diagnosis.observation import slope_along
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.regression import score_each, score_groups
from escalator_twin.diagnosis.search import Search, wrapped
from escalator_twin.errors import EscalatorError
from escalator_twin.machine import Deviation
from escalator_twin.physics import run
from escalator_twin.physics.periodic import between
from escalator_twin.signals import Floats
from escalator_twin.twin import make_simulation

CHUNK = 128
SLOWEST_HZ, ALL_CHANNELS_HZ, FASTEST_HZ = 0.08, 1.0, 10.0
FRAME_HZ = (2.5, 16.0)
FRAME_RATIO = 1.012
FRAME_DAMPING = (0.01, 0.02, 0.04)
FRAME_MASS_KG = 1e6  # of a frame so heavy that it stands still


def drive_waves(search: Search) -> Iterator[Proposal]:
    """Propose a ripple or a hunting of the drive's speed by a frequency of the residual."""
    observation = search.view.observation
    frame = observation.frame
    seconds = observation.travel_m / frame.speed_m_s
    slope = slope_along(search.model, observation.frame.spacing_m)
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
    gravity = search.machine.gravity_m_s2
    moved = [axes[axis] for axis in ('x', 'z') if axis in axes]
    pull = np.clip(search.model[:, moved] / gravity, -1.0, 1.0).astype(np.float32)
    fitted, whiten = search.among(moved)
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
        columns = np.empty((*pull.shape, len(some)), np.float32)
        for k, (f, damping) in enumerate(some):
            own = 2.0 * pi * f
            answer = -(omega**2) / (own**2 - omega**2 + 2j * damping * own * omega) * keep
            lift = fft.irfft(spectrum * answer, size)[: len(force)]
            columns[:, :, k] = pull * between(lift[:, None], where)
        score = score_each(fitted, whiten(columns))
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
