"""Amplitude, phase and coherence at the orders of the machine."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import signal

from escalator_twin.metrics.bands import Bands
from escalator_twin.metrics.filters import centred
from escalator_twin.metrics.track import RIPPLE_FROM, thin_slice
from escalator_twin.signals import Floats

Complexes = NDArray[np.complex128]

SEGMENT_PITCHES = 10.0  # length of a segment; Hann: tells orders 0.2 apart
LEAST_SEGMENTS = 3  # a coherence of fewer says nothing


@dataclass(frozen=True, slots=True)
class OrderScore:
    """Agreement at one order of the machine.

    Attributes
    ----------
    cycles_per_pitch : float
    measured, simulated : float or None
        Amplitudes, the channel's unit.
    amplitude_ratio : float or None
        Simulated over measured.
    phase_deg : float or None
        Simulated ahead of measured, -180 to 180.
    coherence : float or None
        0 to 1: how far the ratio and the phase are the same all along the loop.
    """

    cycles_per_pitch: float
    measured: float | None
    simulated: float | None
    amplitude_ratio: float | None
    phase_deg: float | None
    coherence: float | None


def order_scores(bands: Bands) -> tuple[OrderScore, ...]:
    """Return the agreement at each of the track's orders.

    Amplitudes are those of exp(2 pi i k travel / pitch) over the samples kept. Orders of half
    a cycle per pitch and more are taken from the ripple, with a Hann window over the whole
    length; coherence is Welch's, over segments of ten pitches that overlap by half. Slower
    orders are taken from the signal below 2 Hz over whole loops, unwindowed, ``None`` where
    there is no whole loop; their coherence is over loops, ``None`` for fewer than three.
    """
    track = bands.track
    inner = track.order_step // track.step
    kept = thin_slice(track.kept, track.order_step)
    low = [centred(row[:: track.order_step][kept]) for row in bands.low]
    fast = [row[::inner][kept] for row in bands.ripple]
    return tuple(
        _slow_order(bands, order, low, track.phasors[i])
        if order < RIPPLE_FROM
        else _fast_order(bands, order, fast, track.phasors[i])
        for i, order in enumerate(track.orders)
    )


def _slow_order(bands: Bands, order: float, rows: list[Floats], phasor: Complexes) -> OrderScore:
    """Score an order slower than the ripple, over whole loops."""
    n_loops = bands.track.n_loops
    if n_loops == 0:
        return OrderScore(order, None, None, None, None, None)
    length = len(phasor) // n_loops
    turned = [(row * phasor)[: n_loops * length] for row in rows]
    blocks = [2.0 * row.reshape(n_loops, length).mean(axis=1) for row in turned]
    return _score(order, [block.mean() for block in blocks], blocks)


def _fast_order(bands: Bands, order: float, rows: list[Floats], phasor: Complexes) -> OrderScore:
    """Score an order of the ripple."""
    track = bands.track
    n = len(phasor)
    rate = track.rate_hz / track.order_step
    if n < 2 or not track.speed_m_s > 0.0 or order * track.speed_m_s / track.pitch_m > rate / 2:
        return OrderScore(order, None, None, None, None, None)
    turned = [row * phasor for row in rows]
    half = int(0.5 * SEGMENT_PITCHES * track.pitch_m / track.speed_m_s * rate)
    blocks = [_segments(row, max(half, 1)) for row in turned]
    return _score(order, [np.einsum('i,i->', row, track.hann) for row in turned], blocks)


def _segments(turned: Complexes, half: int) -> Complexes:
    """Return the Hann-weighted sums over segments of twice ``half``, overlapping by half."""
    n_halves = len(turned) // half
    window = signal.windows.hann(2 * half, sym=False)
    table = turned[: n_halves * half].reshape(n_halves, half)
    # rising half of one segment, falling half of the one before
    rising = np.einsum('ij,j->i', table[:-1], window[:half])
    return np.asarray(rising + np.einsum('ij,j->i', table[1:], window[half:]))


def _score(order: float, lines: list[complex], blocks: list[Complexes]) -> OrderScore:
    """Combine complex amplitudes, of all samples and of their blocks, into a score."""
    measured, simulated = complex(lines[0]), complex(lines[1])
    amplitudes = (abs(measured), abs(simulated))
    if amplitudes[0] == 0.0:
        return OrderScore(order, 0.0, amplitudes[1], None, None, None)
    ratio = simulated / measured
    phase = float(np.degrees(np.angle(ratio))) if amplitudes[1] > 0.0 else None
    return OrderScore(order, *amplitudes, abs(ratio), phase, _coherence(*blocks))


def _coherence(measured: Complexes, simulated: Complexes) -> float | None:
    """Return the magnitude-squared coherence over blocks."""
    power = float(np.vdot(measured, measured).real * np.vdot(simulated, simulated).real)
    shared = float(abs(np.vdot(measured, simulated))) ** 2
    if len(measured) < LEAST_SEGMENTS or not power > 0.0:
        return None
    return min(shared / power, 1.0)
