"""What the page was made from."""

from escalator_twin.report.documents import Page
from escalator_twin.report.section import Context, Section


def context(page: Page) -> Context:
    """Return files, schemas and bags."""
    return {
        'sources': page.sources,
        'entries': [
            (entry, entry.data.get('path'))
            for entry in (*page.recordings, *page.checks)
            if entry.data.get('path')
        ],
    }


SECTION = Section('sources', 'Sources', context)
