"""Left against right: how two sides share what they carry together."""

from dataclasses import dataclass

import numpy as np

from escalator_twin.metrics.agreement import correlation, deviation, nrmse
from escalator_twin.metrics.bands import Bands
from escalator_twin.metrics.filters import centred, inner
from escalator_twin.signals import Floats

N_POSITIONS = 12  # parts of a loop in which the share is looked at by itself


@dataclass(frozen=True, slots=True)
class SideScore:
    """Shares of the left side, measured beside simulated.

    Attributes
    ----------
    measured_share, simulated_share : float or None
        Of the variation of left plus right, `share_of_variation`.
    measured_difference, simulated_difference : float or None
        Standard deviation of left minus right over that of left plus right.
    difference_r, difference_nrmse : float or None
        Agreement of left minus right, below 2 Hz.
    measured_by_position, simulated_by_position : tuple of float or None
        The share in each twelfth of a loop, from the first sample scored.
    """

    measured_share: float | None
    simulated_share: float | None
    measured_difference: float | None
    simulated_difference: float | None
    difference_r: float | None
    difference_nrmse: float | None
    measured_by_position: tuple[float | None, ...]
    simulated_by_position: tuple[float | None, ...]


def share_of_variation(left: Floats, right: Floats) -> float | None:
    """Return the left side's share of the variation of ``left + right`` (n,), unitless.

    cov(left, left + right) / var(left + right): the shares of both sides add to one, and no
    zero of an instrument enters. ``None`` where the sum is constant.
    """
    if len(left) < 2:
        return None
    one, total = centred(left), centred(left + right)
    power = inner(total, total)
    return float(inner(one, total) / power) if power > 0.0 else None


def side_scores(left: Bands, right: Bands) -> SideScore:
    """Compare how two channels, one each side, share their force; both on one track."""
    track = left.track
    real = (left.valid & right.valid)[track.kept]
    rows = [row[track.kept][real] for row in (*left.low, *right.low)]
    left_m, left_s, right_m, right_s = rows
    x = track.travel_m[track.kept][real]
    place = np.zeros(0, dtype=np.int64)
    if len(x):
        place = (np.mod(x - x[0], track.loop_m) / track.loop_m * N_POSITIONS).astype(np.int64)
    return SideScore(
        share_of_variation(left_m, right_m),
        share_of_variation(left_s, right_s),
        _difference(left_m, right_m),
        _difference(left_s, right_s),
        correlation(left_m - right_m, left_s - right_s),
        nrmse(left_m - right_m, left_s - right_s),
        _by_position(left_m, right_m, place),
        _by_position(left_s, right_s, place),
    )


def _difference(left: Floats, right: Floats) -> float | None:
    """Return the deviation of left minus right over that of left plus right."""
    total = deviation(left + right)
    return deviation(left - right) / total if total > 0.0 else None


def _by_position(left: Floats, right: Floats, place: np.ndarray) -> tuple[float | None, ...]:
    """Return the left share among the samples of each place, 0 to 11."""
    return tuple(
        share_of_variation(left[place == k], right[place == k]) for k in range(N_POSITIONS)
    )
