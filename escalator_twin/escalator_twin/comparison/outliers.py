"""Outliers that only show beside the twin.

Told from the recording alone (`check.spikes`), an outlier must stand out of the range around it. On the
flank of a force, or among the blows of a step, the smaller ones do not; beside what the machine does they do.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
import re

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.ndimage import median_filter

from escalator_twin.signals import Finding, Floats
from escalator_twin.sync.template import Templates
from escalator_twin.sync.timeline import Timed
from escalator_twin.sync.travel import Travel

SIDE = 3  # samples on either side that tell what one should be
# Of the spread around: white noise passes it less than once in a million samples, and blows ring.
SIGMAS = 6.0
AROUND_S = 1.0  # over which the spread is taken
WIDTHS = (1, 2)  # samples: two of some twenty outliers are neighbours in one recording of thirty
# Of the larger of two neighbours: what differs less is one blow that lasts for two samples, as three did that were counted
# as six outliers of 2 m/s2 beside twenty of up to 20 (an empty step at 0.25 m/s). Outliers of one sign and so alike are
# neighbours in one recording of some two hundred.
BLOW = 0.3
ALONE = 0.3  # of the smaller one's size that those beside may be off
CLEAR = 2  # samples on either side
COUNT = re.compile(r'^(\d+) isolated')


def bridge_left(
    tracks: Mapping[str, Timed],
    templates: Templates,
    travel: Travel,
    findings: Sequence[Finding],
    exchanged: Mapping[str, str] | None = None,
) -> tuple[dict[str, Timed], list[Finding]]:
    """Bridge what is left of outliers, in the channels where some were found.

    Parameters
    ----------
    tracks : mapping of channel to Timed
    templates : Templates
    travel : Travel
        Of ``templates``, over reference time.
    findings : sequence of Finding
        Of channels as they were recorded.
    exchanged : mapping of channel to channel, optional
        Where the signals of exchanged ones are now, see `exchanged.exchanged`.

    Returns
    -------
    tracks : dict
        With the channels mended.
    findings : list of Finding
        Those of outliers count the ones that are bridged here as well.
    """
    mended, told = dict(tracks), []
    for finding in findings:
        channel = (exchanged or {}).get(finding.channel, finding.channel)
        known = COUNT.match(finding.detail)
        is_spiky = finding.kind == 'sensor_spikes' and finding.repaired and known is not None
        if is_spiky and channel in mended and channel in templates.columns:
            track = mended[channel]
            way = travel.at(track.time_s)
            model = CubicSpline(templates.travel_m, templates.columns[channel])(way)
            hit = alone(track.values - model, track.rate_hz) & track.valid
            if hit.any() and known is not None:
                index = np.arange(len(hit))
                values = track.values.copy()
                values[hit] = np.interp(index[hit], index[~hit], track.values[~hit])
                mended[channel] = replace(track, values=values)
                count = int(known[1]) + int(hit.sum())
                detail = COUNT.sub(f'{count} isolated', finding.detail)
                finding = replace(finding, detail=detail)
        told.append(finding)
    return mended, told


def alone(left: Floats, rate_hz: float) -> np.ndarray:
    """Tell of each sample of a residual whether it stands out of those around it, alone or as one of two, (n,)."""
    n = len(left)
    if n < 2 * SIDE + 1:
        return np.zeros(n, dtype=bool)
    padded = np.pad(left, SIDE, mode='edge')
    ways = [k for k in range(2 * SIDE + 1) if k != SIDE]
    away = left - np.median([padded[k : k + n] for k in ways], axis=0)
    off = np.abs(away)
    around = 2 * round(0.5 * AROUND_S * rate_hz) + 1
    spread = 1.4826 * median_filter(off, around, mode='nearest')
    is_far = (off > SIGMAS * spread) & (spread > 0.0)
    beside = np.pad(off, CLEAR)
    found = np.zeros(n, dtype=bool)
    for width in WIDTHS:
        starts = n - width + 1
        least = np.min([off[k : k + starts] for k in range(width)], axis=0)
        clear = [*range(CLEAR), *range(CLEAR + width, 2 * CLEAR + width)]
        most = np.max([beside[k : k + starts] for k in clear], axis=0)
        is_here = np.all([is_far[k : k + starts] for k in range(width)], axis=0)
        is_here &= most < ALONE * least
        if width > 1:
            ends = away[:starts], away[width - 1 :]
            is_here &= np.abs(ends[0] - ends[1]) >= BLOW * np.max(np.abs(ends), axis=0)
        for k in range(width):
            found[k : k + starts] |= is_here
    return found
