"""A comparison's document as messages."""

from collections.abc import Mapping
import math
from typing import Any

from escalator_msgs.msg import ChannelMetrics, Comparison, OrderMetrics, QualityFinding
from escalator_twin.ros.requests import time_message

NUMBERS = (
    'r_time', 'r_freq', 'nrmse', 'lag_s', 'ceiling_r_time', 'ceiling_share', 'ripple_r',
    'ripple_nrmse', 'ripple_ceiling',
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
