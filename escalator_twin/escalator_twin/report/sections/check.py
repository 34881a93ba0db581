"""What is in a recording, as `check` found it."""

from escalator_twin.report.charts import timeline
from escalator_twin.report.documents import Entry, Page, rows, table
from escalator_twin.report.section import Context, Section


def context(page: Page) -> Context | None:
    """Return topics, clocks and findings of each checked recording."""
    if not page.checks:
        return None
    return {'checks': [_check(entry) for entry in page.checks]}


def _check(entry: Entry) -> Context:
    data = entry.data
    findings = rows(data.get('quality'))
    container = table(data.get('container'))
    return {
        'entry': entry,
        'topics': _topics(data.get('topics')),
        'clock': table(data.get('clock')),
        'experiment': {k: v for k, v in table(data.get('experiment')).items() if v != ''},
        'container': {key: value for key, value in container.items() if value},
        'findings': findings,
        'timeline': timeline(findings),
    }


def _topics(topics: object) -> list[Context]:
    """Return the topics as rows, whether they came as a list or by name."""
    if isinstance(topics, dict):
        return [{'topic': name, **table(row)} for name, row in topics.items()]
    return [dict(row) for row in rows(topics)]


SECTION = Section('check', 'What is in the recordings', context)
