"""A comparison as the JSON of contracts.md tells it."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from escalator_twin.check.clock import ClockComparison
from escalator_twin.comparison.clocks import clock_disagreement
from escalator_twin.comparison.judge import Judgement
from escalator_twin.comparison.locate import Setting
from escalator_twin.comparison.riding import ride_document
from escalator_twin.machine import Machine
from escalator_twin.metrics.filters import lowpass
from escalator_twin.signals import Floats, Recording
from escalator_twin.sync.travel import Ground

SCHEMA = 'escalator_twin/compare/1'
OVERLAY_HZ = 20.0  # of the overlays that a page draws
OVERLAY_BAND_HZ = 8.0
DIGITS = 6  # significant, of the overlays


def recording_document(
    recording: Recording, setting: Setting, judgement: Judgement, machine: Machine
) -> dict[str, Any]:
    """Return one recording's part of the JSON.

    Parameters
    ----------
    recording : Recording
    setting : Setting
    judgement : Judgement
    machine : Machine
    """
    assert recording.experiment is not None
    travel = judgement.travel
    clock = setting.comparisons.get(machine.instruments.travelling_logger)
    period = machine.chain.pitch_m / travel.speed_m_s
    known = clock is not None and clock.is_known
    findings = [*setting.findings, *clock_disagreement(judgement.by_signals, known, period)]
    return {
        'path': recording.path,
        'case_id': recording.experiment.case_id,
        'direction': recording.experiment.direction,
        'set_speed_m_s': recording.experiment.set_speed_m_s,
        'experiment': {
            'machine': recording.experiment.machine,
            'load_per_step_kg': list(recording.experiment.load_per_step_kg),
            'preload_n': recording.experiment.preload_n,
            'notes': recording.experiment.notes,
        },
        'speed_m_s': {
            'value': travel.speed_m_s,
            'low': travel.low_m_s,
            'high': travel.high_m_s,
        },
        'start_s_m': judgement.start_s_m if setting.is_certain else None,
        'clock': clock_document(clock, judgement.by_signals),
        'place_lead': setting.lead if np.isfinite(setting.lead) else None,
        'place_is_certain': bool(setting.is_certain),
        'sensor_pose': {k: list(v) for k, v in judgement.pose.items()},
        'channels': {c: dict(s) for c, s in judgement.scores.items()},
        'sides': {link: asdict(side) for link, side in judgement.sides.items()},
        'ride_quality': ride_document(judgement.channels, machine),
        'quality': [
            {
                'kind': f.kind,
                'channel': f.channel,
                'from_s': f.from_s,
                'to_s': f.to_s,
                'detail': f.detail,
                'repaired': f.repaired,
            }
            for f in findings
        ],
        'overlay': overlay(judgement),
    }


def clock_document(clock: ClockComparison | None, by_signals: Ground | None) -> dict[str, Any]:
    """Return the clock by bag time where that tells it, else by the signals alone.

    The signals tell the offset modulo one pitch period.
    """
    known = clock is not None and clock.is_known
    start = (clock.offset_s or 0.0) if clock is not None else 0.0
    rate = (clock.drift_ppm or 0.0) if clock is not None else 0.0
    signals = None
    if by_signals is not None:
        signals = {
            'offset_s': start + by_signals.shift_s,
            'offset_sd_s': by_signals.shift_sd_s,
            'drift_ppm': rate + 1e6 * by_signals.rate,
            'drift_sd_ppm': 1e6 * by_signals.rate_sd,
        }
    best: Mapping[str, Any] = {}
    if known and clock is not None:
        best = {'offset_s': clock.offset_s, 'drift_ppm': clock.drift_ppm}
    elif signals is not None:
        best = signals
    return {
        'offset_s': best.get('offset_s'),
        'drift_ppm': best.get('drift_ppm'),
        'by_bag_time': clock.document() if clock is not None else None,
        'by_signals': signals,
    }


def overlay(judgement: Judgement) -> dict[str, Any]:
    """Return every channel, low-passed and thinned, measured beside simulated, means removed."""
    channels = {}
    for name, aligned in judgement.channels.items():
        step = max(1, round(aligned.rate_hz / OVERLAY_HZ))
        measured = lowpass(aligned.measured, OVERLAY_BAND_HZ, aligned.rate_hz)[::step]
        simulated = lowpass(aligned.simulated, OVERLAY_BAND_HZ, aligned.rate_hz)[::step]
        kept = aligned.valid[::step]
        channels[name] = {
            'time_s': rounded(aligned.time_s[::step]),
            'travel_m': rounded(aligned.travel_m[::step]),
            'place_m': rounded(aligned.place_m[::step]),
            'measured': [
                value if good else None
                for value, good in zip(rounded(measured - measured.mean()), kept, strict=True)
            ],
            'simulated': rounded(simulated - simulated.mean()),
        }
    return {'band_hz': OVERLAY_BAND_HZ, 'channels': channels}


def rounded(values: Floats) -> list[float]:
    """Return values to the digits that a drawing needs."""
    scale = float(np.abs(values).max()) if len(values) else 0.0
    if scale == 0.0:
        return [0.0] * len(values)
    places = int(DIGITS - 1 - np.floor(np.log10(scale)))
    return [float(v) for v in np.round(values, places)]
