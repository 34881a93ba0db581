"""What no cause accounts for, and what else a diagnosis says."""

from escalator_twin.report.documents import is_judged, number, Page, table
from escalator_twin.report.section import Context, Section

TOLD_ELSEWHERE = (
    'by_recording',
    'candidates',
    'effects',
    'extended_machine',
    'extended_machine_yaml',
    'gain',
    'machine',
    'recordings',
    'schema',
    'seconds',
    'unexplained',
    'would_change',
)


def context(page: Page) -> Context | None:
    """Return the unexplained rest of each diagnosis and all keys that no other section tells."""
    if not page.diagnoses:
        return None
    return {
        'rests': [
            {
                'entry': entry,
                'is_judged': is_judged(entry),
                'unexplained': table(entry.data.get('unexplained')),
                'share': number(table(entry.data.get('unexplained')).get('share')),
                'signature': table(table(entry.data.get('unexplained')).get('signature')),
                'more': {k: v for k, v in entry.data.items() if k not in TOLD_ELSEWHERE},
            }
            for entry in page.diagnoses
        ]
    }


SECTION = Section('unexplained', 'Unexplained', context)
