"""Tie a second logger's clock by signals alone, modulo one pitch period."""

from collections.abc import Mapping

import numpy as np
from scipy.interpolate import CubicSpline

from escalator_twin.metrics.filters import lowpass
from escalator_twin.sync.template import Templates
from escalator_twin.sync.timeline import Timed
from escalator_twin.sync.travel import BAND_HZ, EDGE_S, Travel

SCAN_STEP_S = 0.02
# A minimum counts as good as the best up to this factor and this share of the variance: the
# scan's step alone costs a signal of one second's period 0.4 % of it.
NEAR, NEAR_SHARE = 1.1, 0.01


def scan_shift(
    tracks: Mapping[str, Timed],
    templates: Templates,
    travel: Travel,
    reach_s: float,
) -> float:
    """Find the time shift of the tracks at which they agree best with their templates.

    Signals that repeat with every pitch leave the shift open by whole pitch periods; of equally
    good ones the smallest is returned.

    Parameters
    ----------
    tracks : mapping of channel to Timed
        Of the logger to be tied.
    templates : Templates
    travel : Travel
        From the other loggers' signals.
    reach_s : float
        Largest shift looked at, s.

    Returns
    -------
    shift_s : float
    """
    shifts = np.arange(-reach_s, reach_s + SCAN_STEP_S, SCAN_STEP_S)
    misfit = np.zeros(len(shifts))
    for channel, track in tracks.items():
        if channel not in templates.columns:
            continue
        edge = round(EDGE_S * track.rate_hz)
        keep = slice(edge, -edge, max(1, round(track.rate_hz / 20.0)))
        good = track.valid[keep]
        measured = lowpass(track.values, BAND_HZ, track.rate_hz)[keep][good]
        time = track.time_s[keep][good]
        smooth = lowpass(templates.columns[channel], BAND_HZ, templates.rate_hz)
        curve = CubicSpline(templates.travel_m, smooth)
        power = float(np.var(measured))
        if power <= 0.0:
            continue
        for k, shift in enumerate(shifts):
            misfit[k] += float(np.var(measured - curve(travel.at(time + shift)))) / power
    padded = np.concatenate([[np.inf], misfit, [np.inf]])
    is_minimum = (misfit <= padded[:-2]) & (misfit <= padded[2:])
    is_good = misfit <= NEAR * misfit.min() + NEAR_SHARE * len(tracks)
    near = np.flatnonzero(is_minimum & is_good)
    return float(shifts[near[np.argmin(np.abs(shifts[near]))]])
