"""What the page was made from."""

from escalator_twin.report.documents import number, Page
from escalator_twin.report.section import Context, Section


def context(page: Page) -> Context:
    """Return files, schemas and bags, and how long each diagnosis took."""
    return {
        'sources': page.sources,
        'entries': [
            (entry, entry.data.get('path'))
            for entry in (*page.recordings, *page.checks)
            if entry.data.get('path')
        ],
        'seconds': [
            (entry.source, number(entry.data.get('seconds')))
            for entry in page.diagnoses
            if number(entry.data.get('seconds')) is not None
        ],
    }


SECTION = Section('sources', 'Sources', context)
