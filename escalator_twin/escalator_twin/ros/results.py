"""The documents of comparisons and diagnoses as messages."""

from collections.abc import Mapping
import math
from typing import Any

from escalator_msgs.msg import (
    Candidate,
    ChannelGain,
    ChannelMetrics,
    Comparison,
    Diagnosis,
    Effect,
    Location,
    OrderMetrics,
    Parameter,
    QualityFinding,
    Unexplained,
)
from escalator_twin.report.numerals import unit_of
from escalator_twin.ros.requests import time_message

NUMBERS = (
    'r_time', 'r_freq', 'nrmse', 'lag_s', 'ceiling_r_time', 'ceiling_share', 'ripple_r',
    'ripple_nrmse', 'ripple_ceiling',
)  # fmt: skip
GAIN_NUMBERS = (
    'nrmse_before', 'nrmse_after', 'r_time_before', 'r_time_after', 'nrmse_band_before',
    'nrmse_band_after', 'chi2_before', 'chi2_after',
)  # fmt: skip
ORDER_NUMBERS = ('cycles_per_pitch', 'amplitude_ratio', 'phase_deg', 'coherence')


def comparison_message(
    document: Mapping[str, Any], span_s: tuple[float, float], end_ns: int, is_final: bool
) -> Comparison:
    """Return one recording's part of the JSON of ``compare`` as a message.

    Parameters
    ----------
    document : mapping
        As ``recording_document`` gives it.
    span_s : (float, float)
        Begin and end of what was compared, from the recording's start.
    end_ns : int
        That end on the recording's clock.
    is_final : bool
        Whether this is the whole recording.
    """
    speed, clock = document['speed_m_s'], document['clock']
    message = Comparison(
        recording=str(document['path']),
        case_id=str(document['case_id']),
        direction=int(document['direction']),
        set_speed_m_s=_number(document['set_speed_m_s']),
        speed_m_s=_number(speed['value']),
        speed_low_m_s=_number(speed['low']),
        speed_high_m_s=_number(speed['high']),
        start_s_m=_number(document['start_s_m']),
        clock_offset_s=_number(clock['offset_s']),
        clock_drift_ppm=_number(clock['drift_ppm']),
        window_from_s=float(span_s[0]),
        window_to_s=float(span_s[1]),
        final=is_final,
        channels=[_channel(name, scores) for name, scores in document['channels'].items()],
        quality=[quality_message(finding) for finding in document['quality']],
    )
    message.header.stamp = time_message(end_ns)
    return message


def quality_message(finding: Mapping[str, Any]) -> QualityFinding:
    """Return one finding on a recording's quality as a message."""
    return QualityFinding(
        kind=str(finding['kind']),
        channel=str(finding['channel']),
        from_s=_number(finding['from_s']),
        to_s=_number(finding['to_s']),
        detail=str(finding['detail']),
        repaired=bool(finding['repaired']),
    )


def diagnosis_message(document: Mapping[str, Any]) -> Diagnosis:
    """Return the JSON of ``diagnose`` as a message."""
    held_out = document['gain']['held_out'] or {}
    span = (math.nan, math.nan)
    return Diagnosis(
        recordings=[
            comparison_message(part, span, 0, is_final=True) for part in document['recordings']
        ],
        effects=[_effect(effect) for effect in document['effects']],
        candidates=[
            Candidate(
                cause=row['cause'],
                location=_location(row['location']),
                probability=_number(row['probability']),
            )
            for row in document['candidates']
        ],
        unexplained=_unexplained(document['unexplained']),
        extended_machine=str(document['extended_machine']),
        held_out_split=str(held_out.get('split') or document['gain'].get('split') or ''),
        held_out_blocks=int(held_out.get('blocks') or 0),
        gain=[
            ChannelGain(channel=name, **{key: _number(row.get(key)) for key in GAIN_NUMBERS})
            for name, row in (held_out.get('channels') or {}).items()
        ],
    )


def _effect(effect: Mapping[str, Any]) -> Effect:
    return Effect(
        cause=effect['cause'],
        location=_location(effect['location']),
        parameters=[
            Parameter(
                name=name,
                unit=unit_of(name),
                **{key: _number(value.get(key)) for key in ('value', 'low', 'high')},
            )
            for name, value in effect['parameters'].items()
        ],
        probability=_number(effect['probability']),
        alternatives=[str(name) for name in effect['alternatives']],
    )


def _location(place: Mapping[str, Any]) -> Location:
    """Return a place; a link by its name is a measurement's, by its number the machine's."""
    link = place.get('link')
    is_named = isinstance(link, str)
    names = place.get('channels') or place.get('links') or place.get('channel') or []
    return Location(
        link=-1 if link is None or is_named else int(link),
        axle=_index(place.get('axle')),
        step=_index(place.get('step')),
        steps=[int(step) for step in place.get('steps') or ()],
        side=str(place.get('side') or ''),
        s_m=_number(place.get('s_m')),
        s_from_m=_number(place.get('s_from_m')),
        s_to_m=_number(place.get('s_to_m')),
        which=str(place.get('which') or ''),
        instrument=str(link) if is_named else '',
        gauge=int(place.get('gauge') or 0),
        axis=str(place.get('axis') or ''),
        channels=[names] if isinstance(names, str) else [str(name) for name in names],
    )


def _unexplained(rest: Mapping[str, Any]) -> Unexplained:
    signature = rest.get('signature') or {}
    locked = signature.get('locked_to') or ''
    return Unexplained(
        significant=bool(rest['significant']),
        share=_number(rest['share']),
        channels=[str(name) for name in signature.get('channels') or ()],
        locked_to=locked if isinstance(locked, str) else ', '.join(map(str, locked)),
        s_m=_number(signature.get('largest_at_s_m')),
        link=_index(signature.get('link')),
        cycles_per_pitch=_number(_first(signature.get('cycles_per_pitch'))),
        frequency_hz=_number(_first(signature.get('frequencies_hz'))),
    )


def _first(values: Any) -> Any:
    return values[0] if isinstance(values, list) and values else None


def _index(value: Any) -> int:
    return -1 if value is None else int(value)


def _channel(name: str, scores: Mapping[str, Any]) -> ChannelMetrics:
    return ChannelMetrics(
        channel=name,
        orders=[
            OrderMetrics(**{key: _number(order.get(key)) for key in ORDER_NUMBERS})
            for order in scores.get('orders') or ()
        ],
        **{key: _number(scores.get(key)) for key in NUMBERS},
    )


def _number(value: Any) -> float:
    return math.nan if value is None else float(value)
