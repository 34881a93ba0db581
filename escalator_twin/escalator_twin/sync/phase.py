"""Follow the phase of a periodic signal whose frequency wanders slowly."""

import numpy as np
from numpy.typing import NDArray

from escalator_twin.errors import SynchronisationError
from escalator_twin.metrics.filters import Mask
from escalator_twin.signals import Floats
from escalator_twin.sync.course import Basis, Course, huber_weight, LEAST_OBSERVED, robust_scale

Complexes = NDArray[np.complex128]

BLOCK_CYCLES = 2.0  # length of a block; Hann, the next begins half of it later
LEAST_VALID = 0.6  # of a block's samples
ROUNDS = 10
CLEAR = 0.95  # coherence above which a line's phase is taken to keep to the course
SLIP = 0.25  # cycles by which an unclear phase may be off at either end


def follow_phase(
    time_s: Floats, columns: Floats, valid: Mask, base_hz: float, n_multiples: int, wander: float
) -> Course:
    """Return the course of the cycles of signals near ``base_hz``.

    In each block of two cycles the amplitude and phase of the frequency and its multiples
    are fitted. A spline is laid through the phases of all multiples and all signals, each
    weighted by its own scatter about the course. Multiples whose phase does not keep
    to it, as where a sensor rides round the loop, only count where there is no better.

    Parameters
    ----------
    time_s : (n,) float64
        Increasing from 0, s.
    columns : (n, k) float64
        Signals.
    valid : (n, k) bool
        Samples to trust.
    base_hz : float
        Frequency to within a fifth of a cycle over the recording's length.
    n_multiples : int
        Highest multiple that is looked at.
    wander : float
        Relative wander of the frequency.

    Raises
    ------
    SynchronisationError
        Where too few blocks hold samples.
    """
    span = float(time_s[-1])
    rate = (len(time_s) - 1) / span
    n_multiples = max(1, min(n_multiples, int(0.4 * rate / base_hz)))
    centres, lines = fit_blocks(time_s, columns, valid, base_hz, n_multiples)
    multiples = np.tile(np.arange(1.0, n_multiples + 1.0), columns.shape[1])
    basis = Basis.over(span, base_hz * wander)
    design = basis.at(centres)
    # the first guess is good enough to tell which cycle a phase belongs to
    cycles, n_free = np.zeros(design.shape[1]), 2.0
    for _ in range(ROUNDS):
        observed, variance, clear = _observe(lines, multiples, design @ cycles, n_free)
        smooth = basis.smooth(design, observed, variance)
        cycles, n_free = smooth.cycles, smooth.n_free
    residual = (observed - design @ cycles) / np.sqrt(variance)
    least = 0.0 if clear else 2.0 * SLIP / span
    return basis.course(base_hz, smooth, residual, clear, least)


def fit_blocks(
    time: Floats, columns: Floats, valid: Mask, base_hz: float, n_multiples: int
) -> tuple[Floats, Complexes]:
    """Fit the lines of each block by least squares.

    Returns
    -------
    centres : (b,) float64
        Times of the blocks, s.
    lines : (b, k * n_multiples) complex128
        Amplitudes against exp(2 pi i multiple base_hz time); NaN where samples are missing.
    """
    length = BLOCK_CYCLES / base_hz
    starts = np.arange(0.0, time[-1] - length + 1e-9, 0.5 * length)
    lines_hz: Floats = base_hz * np.arange(1.0, n_multiples + 1.0)
    lines = np.full((len(starts), columns.shape[1], n_multiples), np.nan, dtype=np.complex128)
    expected = length * (len(time) - 1) / time[-1]
    for b, start in enumerate(starts):
        here = slice(*np.searchsorted(time, [start, start + length]))
        for k in range(columns.shape[1]):
            real = valid[here, k]
            if real.sum() >= LEAST_VALID * expected:
                place = (time[here][real] - start) / length
                lines[b, k] = _fit_block(time[here][real], place, columns[here, k][real], lines_hz)
    flat = lines.reshape(len(starts), -1)
    seen = np.isfinite(flat).any(axis=1)
    if seen.sum() < LEAST_OBSERVED:
        raise SynchronisationError(
            f'speed: expected at least {LEAST_OBSERVED} stretches of {length:.1f} s with '
            f'samples, found {int(seen.sum())}'
        )
    return (starts + 0.5 * length)[seen], flat[seen]


def _fit_block(t: Floats, place: Floats, values: Floats, lines_hz: Floats) -> Complexes:
    """Return the amplitudes of lines in one block beside a straight line, Hann-weighted."""
    weight = np.sin(np.pi * place)
    angles = 2.0 * np.pi * np.outer(t, lines_hz)
    trend = np.column_stack([np.ones(len(t)), place])
    design = np.hstack([trend, np.cos(angles), np.sin(angles)]) * weight[:, None]
    found = np.linalg.lstsq(design, (values - values.mean()) * weight, rcond=None)[0]
    n = len(lines_hz)
    return np.asarray(found[2 : 2 + n] - 1j * found[2 + n :])


def _observe(
    lines: Complexes, multiples: Floats, cycles: Floats, n_free: float
) -> tuple[Floats, Floats, bool]:
    """Combine all lines into one phase per block about a known course.

    Returns
    -------
    observed : (b,) float64
        Cycles.
    variance : (b,) float64
        Of these, infinite where nothing was seen.
    clear : bool
        At least one line keeps to the course.
    """
    straight = lines * np.exp(-2j * np.pi * np.outer(cycles, multiples))
    seen = np.isfinite(straight)
    mean = np.nanmean(straight, axis=0)
    power = np.sqrt(np.nanmean(np.abs(straight) ** 2, axis=0))
    coherence = np.where(power > 0.0, np.abs(mean) / np.maximum(power, 1e-300), 0.0)
    used = np.flatnonzero((coherence >= min(CLEAR, coherence.max())) & (coherence > 0.0))
    total, weights = np.zeros(len(cycles)), np.zeros(len(cycles))
    for i in used:
        # not the angle: a block whose phase is anywhere must not count a whole cycle
        off = (straight[seen[:, i], i] / mean[i]).imag / (2.0 * np.pi * multiples[i])
        weight = huber_weight(off, robust_scale(off, n_free))
        total[seen[:, i]] += weight * off
        weights[seen[:, i]] += weight
    with np.errstate(divide='ignore'):
        variance = 1.0 / weights
    return cycles + total / np.maximum(weights, 1e-300), variance, bool(coherence.max() >= CLEAR)
