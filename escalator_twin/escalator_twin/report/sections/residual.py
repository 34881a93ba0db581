"""What remains of each recording, by channel and by what it is locked to."""

from pathlib import PurePath

from escalator_twin.report.documents import Entry, Json, Page, rows, table, text
from escalator_twin.report.section import Context, Section

COLUMNS = ('chi2', 'pitch_multiples', 'next_loop', 'other_side', 'loaded_run')


def context(page: Page) -> Context | None:
    """Return every recording's residual without and with the named causes."""
    found = [
        part
        for entry in page.diagnoses
        for row in rows(entry.data.get('by_recording'))
        for part in _parts(entry, row)
    ]
    return {'parts': found, 'columns': COLUMNS} if found else None


def _parts(entry: Entry, row: Json) -> list[Context]:
    residual = table(row.get('residual'))
    before, after = table(residual.get('before')), table(residual.get('after'))
    if not before:
        return []
    channels = [
        {'name': name, 'before': table(before[name]), 'after': table(after.get(name))}
        for name in before
    ]
    label = PurePath(text(row.get('path'))).name
    return [{'entry': entry, 'label': label, 'channels': channels}]


SECTION = Section('residual', 'What remains, and what it is locked to', context)
