"""All causes that were weighed, best first, and what speaks for and against each."""

from escalator_twin.report.channels import union
from escalator_twin.report.documents import Json, Page, rows
from escalator_twin.report.section import Context, Section

OWN = ('cause', 'location', 'probability', 'evidence')
SHOWN = 12  # more are folded away


def context(page: Page) -> Context | None:
    """Return the candidates of each diagnosis, with whatever columns they carry."""
    weighed = [(entry, rows(entry.data.get('candidates'))) for entry in page.diagnoses]
    weighed = [(entry, candidates) for entry, candidates in weighed if candidates]
    if not weighed:
        return None
    return {
        'weighed': [
            {
                'entry': entry,
                'candidates': [(row, _evidence(row)) for row in candidates],
                'columns': union([[k for k in row if k not in OWN] for row in candidates]),
                'would_change': _texts(entry.data.get('would_change')),
            }
            for entry, candidates in weighed
        ],
        'shown': SHOWN,
    }


def _evidence(candidate: Json) -> list[tuple[str, str]]:
    """Return lines of evidence with ``for``, ``against`` or nothing before them."""
    evidence = candidate.get('evidence')
    if isinstance(evidence, dict):
        return [
            (side if side in ('for', 'against') else '', line)
            for side, lines in evidence.items()
            for line in _texts(lines)
        ]
    return [('', line) for line in _texts(evidence)]


def _texts(value: object) -> list[str]:
    if isinstance(value, str):
        return [value]
    return [item for item in value if isinstance(item, str)] if isinstance(value, list) else []


SECTION = Section('candidates', 'What was weighed', context)
