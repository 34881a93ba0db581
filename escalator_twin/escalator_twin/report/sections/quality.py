"""What is wrong with the recordings themselves."""

from escalator_twin.report.charts import timeline
from escalator_twin.report.documents import Page, rows
from escalator_twin.report.section import Context, Section


def context(page: Page) -> Context | None:
    """Return the findings of all compared recordings."""
    if not page.recordings:
        return None
    found = [(entry, rows(entry.data.get('quality'))) for entry in page.recordings]
    return {'found': [(entry, list_, timeline(list_)) for entry, list_ in found if list_]}


SECTION = Section('quality', 'Findings in the recordings', context)
