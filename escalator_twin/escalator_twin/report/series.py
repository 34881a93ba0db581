"""Signals as a page carries them: 16 bits a value, in base64, a line taken off first."""

import base64
from typing import Any

import numpy as np

from escalator_twin.report.documents import number, numbers
from escalator_twin.signals import Floats

LEVELS = 32767  # of int16 on each side of zero
GAP = -32768  # stands for a value that is not there
CONSTANT = 1e-12  # a remainder below this share of the largest value is none


def pack(values: Floats, straighten: bool = False) -> dict[str, Any]:
    """Return values as ``a + b i + s q[i]``, q being int16 in little-endian base64.

    Parameters
    ----------
    values : (n,) float64
        NaN where there is none.
    straighten : bool
        Take the line through the first and the last value off: for times and travel.

    Returns
    -------
    dict
        ``n, a, b, s, q``; no ``q`` where nothing remains.
    """
    known = np.isfinite(values)
    n = len(values)
    if not known.any():
        return {'n': n, 'a': 0.0, 'b': 0.0, 's': 0.0, 'q': _encode(np.full(n, GAP))}
    slope = 0.0
    start = float(values[known][0])
    if straighten and known[0] and known[-1] and n > 1:
        slope = float(values[-1] - values[0]) / (n - 1)
    rest = values - start - slope * np.arange(n)
    low, high = float(rest[known].min()), float(rest[known].max())
    middle, half = (low + high) / 2, (high - low) / 2
    packed: dict[str, Any] = {'n': n, 'a': start + middle, 'b': slope, 's': half / LEVELS}
    if half > CONSTANT * float(np.abs(values[known]).max()) or not known.all():
        levels = np.round((rest - middle) / (half or 1.0) * LEVELS)
        packed['q'] = _encode(np.where(known, levels, GAP))
    return packed


def unpack(packed: dict[str, Any]) -> Floats:
    """Return the values that `pack` packed, as the page does."""
    n = packed['n']
    line = packed['a'] + packed['b'] * np.arange(n)
    if 'q' not in packed:
        return line
    levels = np.frombuffer(base64.b64decode(packed['q']), '<i2').astype(np.float64)
    return np.where(levels == GAP, np.nan, line + packed['s'] * levels)


def _encode(levels: Floats) -> str:
    with np.errstate(invalid='ignore'):
        return base64.b64encode(levels.astype('<i2').tobytes()).decode('ascii')


def array(values: Any) -> Floats:
    """Return a list of a document as an array, NaN in the place of what is no number."""
    try:
        found = np.array(values if isinstance(values, list) else [], dtype=np.float64)
    except (TypeError, ValueError):
        found = np.zeros((0, 0))
    if found.ndim == 1:
        return found
    return np.array([np.nan if v is None else v for v in numbers(values)], dtype=np.float64)


def largest(*columns: Floats) -> float:
    """Return the largest absolute value, 0 where there is none."""
    peaks = [float(np.nanmax(np.abs(c))) for c in columns if np.isfinite(c).any()]
    return max(peaks, default=0.0)


def spectrum(time_s: Floats, values: Floats, upper_hz: float) -> tuple[Floats, Floats] | None:
    """Return frequencies and amplitudes up to ``upper_hz``, Hann window; ``None`` if too short.

    Gaps are bridged by straight lines: a page shows a spectrum, it does not judge by it.
    """
    known = np.isfinite(values) & np.isfinite(time_s)
    n = len(values)
    if known.sum() < 16:
        return None
    step = float(np.median(np.diff(time_s)))
    if not step > 0.0:
        return None
    index = np.arange(n)
    filled = np.interp(index, index[known], values[known])
    window = np.hanning(n)
    line = np.fft.rfft((filled - filled.mean()) * window)
    frequency = np.arange(len(line)) / (n * step)
    kept = (frequency > 0.0) & (frequency <= upper_hz)
    if kept.sum() < 2:
        return None
    amplitude: Floats = 2.0 * np.abs(line[kept]) / window.sum()
    return frequency[kept], amplitude


def band(overlay: Any, default: float) -> float:
    """Return the band that an overlay was limited to, Hz."""
    told = number(overlay)
    return told if told is not None and told > 0.0 else default
