"""Speed, place and clocks: what was found before anything was compared."""

from escalator_twin.report.documents import Entry, Json, number, Page, table
from escalator_twin.report.published import speed_error
from escalator_twin.report.section import Context, Section


def context(page: Page) -> Context | None:
    """Return one row a recording."""
    if not page.recordings:
        return None
    rows = [_row(entry) for entry in page.recordings]
    return {'rows': rows, 'has_lead': any(row['lead'] is not None for row in rows)}


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
        'lead': number(data.get('place_lead')),
        'clock': clock,
        'offset_doubt': _half(_interval(clock), 'offset_low_s', 'offset_high_s'),
        'drift_doubt': _half(_interval(clock), 'drift_low_ppm', 'drift_high_ppm'),
    }


def _interval(clock: Json) -> Json:
    """Return where the interval of the clocks stands: in the estimate by bag time, if anywhere."""
    return table(clock.get('by_bag_time')) or clock


def _half(values: Json, low: str, high: str) -> float | None:
    ends = number(values.get(low)), number(values.get(high))
    return (ends[1] - ends[0]) / 2 if ends[0] is not None and ends[1] is not None else None


SECTION = Section('setting', 'Speed, place and clocks', context)
