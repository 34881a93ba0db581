"""Every recording by itself: scores, overlays, spectra, orders."""

from typing import Any

from escalator_twin.report.documents import Entry, Json, number, Page, rows, table
from escalator_twin.report.drawing import still
from escalator_twin.report.scores import SCORES, share
from escalator_twin.report.section import Context, Section
from escalator_twin.report.stacks import signal_stack, spectrum_stack, Stack

OPEN = 1  # recordings whose details are open at first, where there are several
SHOWN = ('ceiling_r_time', 'ceiling_share', 'ripple_ceiling', 'orders')  # of a channel
TOLD_ELSEWHERE = (
    'case_id',
    'channels',
    'clock',
    'direction',
    'overlay',
    'path',
    'place_lead',
    'quality',
    'ride_quality',
    'sensor_pose',
    'set_speed_m_s',
    'speed_m_s',
    'start_s_m',
)
COHERENT = 0.5  # below, ratio and phase of an order are printed pale


def context(page: Page) -> Context | None:
    """Return everything of each recording."""
    if not page.recordings:
        return None
    return {
        'chapters': [_chapter(entry) for entry in page.recordings],
        'n_open': OPEN,
        'scores': SCORES,
        'coherent': COHERENT,
    }


def _chapter(entry: Entry) -> Context:
    signals = signal_stack(entry)
    spectra = spectrum_stack(entry, signals) if signals else None
    channels = {name: table(scores) for name, scores in entry.data['channels'].items()}
    return {
        'entry': entry,
        'channels': channels,
        'shares': {
            name: share(scores, 'ripple_r', 'ripple_ceiling') for name, scores in channels.items()
        },
        'notes': {name: _note(scores) for name, scores in channels.items()},
        'ceiling_share': _span([number(s.get('ceiling_share')) for s in channels.values()]),
        'further': _further(channels),
        'more': {key: value for key, value in entry.data.items() if key not in TOLD_ELSEWHERE},
        'pose': table(entry.data.get('sensor_pose')),
        'band_hz': number(table(entry.data.get('overlay')).get('band_hz')),
        'signals': _drawn(signals) if signals else None,
        'spectra': _drawn(spectra) if spectra else None,
        'orders': _orders(channels),
    }


def _note(scores: Json) -> str:
    """Return what a plot's caption repeats of the scores."""
    parts = [
        f'{title} {score.show(number(scores.get(score.key)))}'
        for title, score in (('r', SCORES['r_time']), ('NRMSE', SCORES['nrmse']))
        if number(scores.get(score.key)) is not None
    ]
    return ', '.join(parts)


def _drawn(stack: Stack) -> dict[str, Any]:
    """Return a stack with its still pictures."""
    axis = next(axis for axis in stack.axes if axis.name == stack.first_axis)
    return {
        'stack': stack,
        'packed': stack.packed(),
        'stills': [still(panel, axis) for panel in stack.panels],
        'is_extended': any('extended' in panel.y for panel in stack.panels),
    }


def _span(values: list[float | None]) -> tuple[float, float] | None:
    known = [value for value in values if value is not None]
    return (min(known), max(known)) if known else None


def _further(channels: dict[str, Json]) -> dict[str, Json]:
    """Return the scores that the first table does not have, parts of a score apart."""
    found: dict[str, dict[str, Any]] = {}
    for name, scores in channels.items():
        for key, value in scores.items():
            if key in SCORES or key in SHOWN:
                continue
            parts = value if isinstance(value, dict) else {'': value}
            found.setdefault(name, {}).update({f'{key} {k}'.strip(): v for k, v in parts.items()})
    return dict(found)


def _orders(channels: dict[str, Any]) -> Context | None:
    """Return the orders that any channel has, and each channel's scores at them."""
    tables = {
        name: {round(order, 6): row for row in rows(scores.get('orders')) if (order := _of(row))}
        for name, scores in channels.items()
    }
    known = sorted({order for found in tables.values() for order in found})
    if not known:
        return None
    return {'orders': known, 'tables': {name: found for name, found in tables.items() if found}}


def _of(row: Any) -> float:
    return number(row.get('cycles_per_pitch')) or 0.0


SECTION = Section('recordings', 'Recordings', context)
