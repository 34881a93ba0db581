"""Inverted axes and exchanged channels, as the twin shows them once the place is known."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from itertools import combinations

import numpy as np
from scipy.interpolate import CubicSpline

from escalator_twin.comparison.units import require_unit
from escalator_twin.machine import Machine, Sensor
from escalator_twin.metrics.filters import lowpass
from escalator_twin.signals import Finding, Floats
from escalator_twin.sync.template import Templates
from escalator_twin.sync.timeline import Timed
from escalator_twin.sync.travel import BAND_HZ, Travel

# A channel counts as inverted where its squared correlation is at least this, with the wrong sign:
# gravity alone, seen through the inclines, explains more than nine tenths of a healthy axis, and weight
# on the inclines as much of a link's force.
INVERTED_R2 = 0.8
INVERTIBLE = ('step_acceleration', 'link_force')
# ... and where bag time ties the clocks: a carriage's waves are their negative half a pitch on.
WAVES = ('carriage_displacement',)
# Two channels count as exchanged where the exchange multiplies the residual variance of both
# together by less than this: left and right of one link differ by less, two links by more.
EXCHANGED = 0.05
FLOOR = 1e-4  # of variance: agreement better than this is not weighed
BLOCK_S = 1.0  # of a robust standard error: waves of the band do not reach over it
SURE = 3.0  # standard errors by which an axis is nearer to its negative than to nothing


def mend_by_model(
    tracks: Mapping[str, Timed],
    low: Mapping[str, Floats],
    templates: Templates,
    speed_m_s: float,
    start_m: float,
    machine: Machine,
    is_tied: bool = False,
) -> tuple[dict[str, Timed], list[Finding]]:
    """Turn inverted channels, and put exchanged ones back.

    Parameters
    ----------
    tracks : mapping of channel to Timed
    low : mapping of channel to (n,) float64
        Their values, low-passed.
    templates : Templates
    speed_m_s, start_m : float
        Mean speed, and travel of the template at reference time 0.
    machine : Machine
    is_tied : bool
        Whether bag time ties the loggers' clocks.

    Returns
    -------
    tracks : dict
        With the channels mended.
    findings : list of Finding
        ``axis_inverted`` and ``channel_swap``, repaired.

    Raises
    ------
    RecordingError
        Where a channel's unit is another one, see `require_unit`.
    """
    mended, findings = dict(tracks), []
    edge = {c: round(t.rate_hz) for c, t in tracks.items()}

    def seen(measured: str, simulated: str) -> tuple[float, float]:
        """Return the signed squared correlation of one channel with another's template, and its slope over it."""
        keep = slice(edge[measured], -edge[measured], 10)
        good = tracks[measured].valid[keep]
        travel = start_m + speed_m_s * tracks[measured].time_s[keep][good]
        model = CubicSpline(templates.travel_m, templates.columns[simulated])(travel)
        values = low[measured][keep][good]
        if len(values) < 3 or np.std(values) == 0.0 or np.std(model) == 0.0:
            return 0.0, 1.0
        r = float(np.corrcoef(values, model)[0, 1])
        return r * abs(r), r * float(np.std(values) / np.std(model))

    def agreement(measured: str, simulated: str) -> float:
        return seen(measured, simulated)[0]

    sensors = [s for s in machine.instruments.sensors if s.channel in tracks]
    for sensor in sensors:
        if sensor.channel in templates.columns:
            require_unit(sensor, *seen(sensor.channel, sensor.channel))
    # First: half a loop apart, where one link is pulled up the other comes down, and what is another's seems turned.
    comes_from: dict[str, str] = {}
    for one, other in _exchanged(sensors, agreement):
        a, b = mended[one], mended[other]
        mended[one], mended[other] = replace(b, channel=one), replace(a, channel=other)
        comes_from |= {one: other, other: one}
        findings.append(_finding('channel_swap', one, a, f'exchanged with {other}'))
    for sensor in sensors:
        channel = sensor.channel
        may_be = sensor.quantity in INVERTIBLE or (is_tied and sensor.quantity in WAVES)
        if not may_be or channel not in templates.columns:
            continue
        if agreement(comes_from.get(channel, channel), channel) < -INVERTED_R2:
            track = mended[channel]
            mended[channel] = replace(track, values=-track.values)
            findings.append(_finding('axis_inverted', channel, track, 'reads with the wrong sign'))
    return mended, findings


def turn_by_waves(
    tracks: Mapping[str, Timed], templates: Templates, travel: Travel, machine: Machine
) -> tuple[dict[str, Timed], list[Finding]]:
    """Turn axes of which gravity says nothing, once every sample's travel is known.

    A sideways axis reads gravity only as far as its sensor is turned, by either sign. Beside what the
    other axes put into it, it follows the twin's own waves there with a factor: 1 where it is right, -1
    where it is inverted.

    Parameters
    ----------
    tracks, templates, machine
        As of `mend_by_model`.
    travel : Travel
        Of ``templates``, over reference time.

    Returns
    -------
    tracks : dict
        With the channels mended.
    findings : list of Finding
        ``axis_inverted``, repaired.
    """
    mended, findings = dict(tracks), []
    for step in {s.at.get('step') for s in _accelerometers(machine)}:
        axes = [
            s.channel
            for s in _accelerometers(machine)
            if s.at.get('step') == step and s.channel in templates.columns
        ]
        for channel in axes:
            if channel not in tracks:
                continue
            factor, sd = _followed(tracks[channel], axes, templates, travel)
            if factor + SURE * sd < -0.5:
                track = mended[channel]
                mended[channel] = replace(track, values=-track.values)
                findings.append(
                    _finding('axis_inverted', channel, track, 'reads with the wrong sign')
                )
    return mended, findings


def _accelerometers(machine: Machine) -> list[Sensor]:
    return [s for s in machine.instruments.sensors if s.quantity == 'step_acceleration']


def _followed(
    track: Timed, axes: list[str], templates: Templates, travel: Travel
) -> tuple[float, float]:
    """Return by which factor an axis follows its template beside the other axes', and its error.

    The error is told by what is left in blocks: waves that last are no independent samples.
    """
    edge = round(track.rate_hz)
    good = track.valid.copy()
    good[:edge] = good[len(good) - edge :] = False
    way = travel.at(track.time_s)[good]
    smooth = {c: lowpass(templates.columns[c], BAND_HZ, templates.rate_hz) for c in axes}
    others = [CubicSpline(templates.travel_m, smooth[c])(way) for c in axes if c != track.channel]
    own = CubicSpline(templates.travel_m, smooth[track.channel])(way)
    values = lowpass(track.values, BAND_HZ, track.rate_hz)[good]
    known = np.stack([*others, np.ones_like(own)], axis=1)
    blocks = round(len(own) / (BLOCK_S * track.rate_hz))
    if blocks < 3:
        return 0.0, np.inf
    own, values = (v - known @ np.linalg.lstsq(known, v, rcond=None)[0] for v in (own, values))
    power = float(own @ own)
    if power == 0.0:
        return 0.0, np.inf
    factor = float(own @ values) / power
    left = own * (values - factor * own)
    sums = np.array([part.sum() for part in np.array_split(left, blocks)])
    return factor, float(np.sqrt(np.sum(sums**2))) / power


def _exchanged(
    sensors: list[Sensor], agreement: Callable[[str, str], float]
) -> list[tuple[str, str]]:
    """Return pairs of channels of one kind that agree far better when exchanged, also than turned about both."""
    pairs = []
    for one, other in combinations([s for s in sensors if s.quantity == 'link_force'], 2):
        if one.unit != other.unit or one.rate_hz != other.rate_hz:
            continue
        a, b = one.channel, other.channel
        own = agreement(a, a), agreement(b, b)
        straight, turned = (_left(f(own[0])) * _left(f(own[1])) for f in (float, abs))
        crossed = _left(agreement(a, b)) * _left(agreement(b, a))
        if crossed < min(EXCHANGED * straight, turned):
            pairs.append((a, b))
    return pairs


def _left(squared: float) -> float:
    """Return the share of variance that is left."""
    return 1.0 - max(squared, 0.0) + FLOOR


def _finding(kind: str, channel: str, track: Timed, text: str) -> Finding:
    span = float(track.time_s[-1] - track.time_s[0])
    return Finding(kind, channel, 0.0, span, text, repaired=True)
