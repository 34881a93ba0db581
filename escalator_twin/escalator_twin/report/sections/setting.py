"""Speed, place and clocks: what was found before anything was compared."""

from escalator_twin.report.documents import Entry, Json, number, Page, table
from escalator_twin.report.published import speed_error
from escalator_twin.report.section import Context, Section

NORMAL_95 = 1.96  # standard deviations of a 95 % interval


def context(page: Page) -> Context | None:
    """Return one row a recording."""
    if not page.recordings:
        return None
    rows = [_row(entry) for entry in page.recordings]
    return {'rows': rows, 'has_signals': any(row['signals'] for row in rows)}


def _row(entry: Entry) -> Context:
    data = entry.data
    clock = table(data.get('clock'))
    return {
        'entry': entry,
        'direction': data.get('direction'),
        'set': number(data.get('set_speed_m_s')),
        'speed': table(data.get('speed_m_s')),
        'error': speed_error(data),
        'start': number(data.get('start_s_m')),
        'clock': clock,
        'offset_doubt': _half(_interval(clock), 'offset_low_s', 'offset_high_s'),
        'signals': _by_signals(table(clock.get('by_signals'))),
        'drift_doubt': _half(_interval(clock), 'drift_low_ppm', 'drift_high_ppm'),
    }


def _by_signals(told: Json) -> Context | None:
    """Return the second estimate of the clocks with its 95 % doubts."""
    offset, drift = number(told.get('offset_s')), number(told.get('drift_ppm'))
    if offset is None or drift is None:
        return None
    doubts = number(told.get('offset_sd_s')), number(told.get('drift_sd_ppm'))
    return {
        'offset': offset,
        'drift': drift,
        'offset_doubt': None if doubts[0] is None else NORMAL_95 * doubts[0],
        'drift_doubt': None if doubts[1] is None else NORMAL_95 * doubts[1],
    }


def _interval(clock: Json) -> Json:
    """Return where the interval of the clocks stands: in the estimate by bag time, if anywhere."""
    return table(clock.get('by_bag_time')) or clock


def _half(values: Json, low: str, high: str) -> float | None:
    ends = number(values.get(low)), number(values.get(high))
    return (ends[1] - ends[0]) / 2 if ends[0] is not None and ends[1] is not None else None


SECTION = Section('setting', 'Speed, place and clocks', context)
