"""The objective rating of ISO/TS 18571, by a library kept by others, one loop at a time."""

from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from typing import cast, Protocol

import numpy as np

from escalator_twin.errors import NotYetError
from escalator_twin.metrics.bands import Bands
from escalator_twin.metrics.filters import centred
from escalator_twin.signals import Floats

LIBRARY = 'objective_rating_metrics'  # VSI, TU Graz; MIT
POINTS = 1000  # per loop, even in travel: 2.5 cm on a loop of 24 m
PARTS = ('overall', 'corridor', 'phase', 'magnitude', 'slope')


class Rating(Protocol):
    """What is used of the library's class."""

    def overall_rating(self, ndigits: int) -> float: ...
    def corridor_rating(self, ndigits: int) -> float: ...
    def phase_rating(self, ndigits: int) -> float: ...
    def magnitude_rating(self, ndigits: int) -> float: ...
    def slope_rating(self, ndigits: int) -> float: ...


def iso_18571(bands: Bands) -> dict[str, float | None]:
    """Return the ratings of ISO/TS 18571, 0 to 1, as means over the whole loops.

    Each loop of the signals below 2 Hz is resampled to 1000 points, even in travel; means are
    removed, as they are zeros of instruments, while the corridor's width is a share of
    the largest measured value. Keys ``overall`` (0.4 corridor, 0.2 each of the others),
    ``corridor``, ``phase``, ``magnitude``, ``slope``; ``None`` where there is no whole loop
    or a signal is constant.

    Raises
    ------
    NotYetError
        Where the library is not installed.
    """
    if find_spec(LIBRARY) is None:
        raise NotYetError(
            f'iso_18571: ISO/TS 18571 is computed by {LIBRARY}, which is not installed'
        )
    rate = cast(Callable[..., Rating], import_module(f'{LIBRARY}.rating').ISO18571)
    rows = []
    for measured, simulated in _loops(bands):
        if not (measured.any() and simulated.any()):
            continue
        time = np.arange(POINTS) / POINTS
        rating = rate(np.column_stack([time, measured]), np.column_stack([time, simulated]))
        rows.append([float(getattr(rating, f'{part}_rating')(ndigits=-1)) for part in PARTS])
    if not rows:
        return dict.fromkeys(PARTS)
    return {part: float(mean) for part, mean in zip(PARTS, np.mean(rows, axis=0), strict=True)}


def _loops(bands: Bands) -> list[tuple[Floats, Floats]]:
    """Return each whole loop, measured and simulated, centred, at even steps of travel."""
    track = bands.track
    travel = track.travel_m[track.kept]
    measured, simulated = (row[track.kept] for row in bands.low)
    loops = []
    for i in range(track.n_loops):
        places = travel[0] + track.loop_m * (i + np.arange(POINTS) / POINTS)
        loops.append(
            (
                centred(np.interp(places, travel, measured)),
                centred(np.interp(places, travel, simulated)),
            )
        )
    return loops
