"""What each recording of a diagnosis says by itself, where there are several."""

from pathlib import PurePath

from escalator_twin.report.documents import Entry, Json, number, Page, rows, table, text
from escalator_twin.report.section import Context, Section


def context(page: Page) -> Context | None:
    """Return a table a diagnosis of several recordings."""
    told = [(entry, rows(entry.data.get('by_recording'))) for entry in page.diagnoses]
    several = [
        {'entry': entry, 'recordings': [_recording(entry, i, row) for i, row in enumerate(found)]}
        for entry, found in told
        if len(found) > 1
    ]
    return {'diagnoses': several} if several else None


def _recording(entry: Entry, index: int, row: Json) -> Context:
    path = text(row.get('path'))
    compared = rows(entry.data.get('recordings'))
    same = next((part for part in compared if part.get('path') == path), {})
    rest = table(row.get('unexplained'))
    gain = table(row.get('gain'))
    return {
        'label': text(table(same).get('case_id')) or PurePath(path).name or f'{index + 1}',
        'path': path,
        'effects': [
            {
                'cause': text(effect.get('cause')),
                'location': table(effect.get('location')),
                'parameters': table(effect.get('parameters')),
                'probability': number(effect.get('probability')),
            }
            for effect in rows(row.get('effects'))
        ],
        'is_judged': table(same).get('place_is_certain') is not False,
        'is_unexplained': rest.get('significant') is True,
        'share': number(rest.get('share')),
        'best': _best(table(gain.get('channels'))),
        'is_significant': gain.get('significant'),
        'blocks': number(gain.get('blocks')),
    }


def _best(channels: Json) -> tuple[str, float, float] | None:
    """Return the channel whose chi squared falls most, relative to before, and both values."""
    found = []
    for name, scores in channels.items():
        before = number(table(scores).get('chi2_before'))
        after = number(table(scores).get('chi2_after'))
        if before is not None and after is not None and before > 0.0:
            found.append((after / before, name, before, after))
    return min(found)[1:] if found else None


SECTION = Section('by-recording', 'Recordings one by one', context)
