"""What is wrong with the recordings themselves."""

from escalator_twin.report.charts import timeline
from escalator_twin.report.documents import Json, numbers, Page, rows, table
from escalator_twin.report.section import Context, Section


def context(page: Page) -> Context | None:
    """Return the findings of all compared recordings."""
    if not page.recordings:
        return None
    found = [(entry, rows(entry.data.get('quality'))) for entry in page.recordings]
    return {
        'found': [
            (entry, list_, timeline(list_, _until_s(entry.data)))
            for entry, list_ in found
            if list_
        ]
    }


def _until_s(data: Json) -> float:
    """Return the last time of a recording's overlays; 0 where there are none."""
    channels = table(table(data.get('overlay')).get('channels')).values()
    times = [numbers(table(columns).get('time_s'))[-1:] for columns in channels]
    return max((time for last in times for time in last if time is not None), default=0.0)


SECTION = Section('quality', 'Findings in the recordings', context)
