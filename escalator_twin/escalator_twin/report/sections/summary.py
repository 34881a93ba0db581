"""What the page is about, in a few lines and numbers."""

from pathlib import PurePath
import re

from escalator_twin.report.channels import union
from escalator_twin.report.documents import Entry, is_judged, number, Page, rows, table, text
from escalator_twin.report.section import Context, Section

# Words by which a case or its notes say that the recording was computed, not taken at a machine.
SYNTHETIC = re.compile(r'synthetic|simulat|virtual|generated|reference rig', re.IGNORECASE)


def context(page: Page) -> Context:
    """Return machines, counts, the weakest agreement, and where data are synthetic."""
    entries = (*page.recordings, *page.checks)
    machines = union([[e.machine for e in (*entries, *page.diagnoses) if e.machine]])
    return {
        'machines': [(PurePath(name).stem, name) for name in machines],
        'synthetic': [entry.label for entry in entries if _is_synthetic(entry)],
        'n_synthetic_of': len(entries),
        'channels': union([list(table(e.data['channels'])) for e in page.recordings]),
        'weakest': _weakest(page),
        'n_findings': sum(len(rows(entry.data.get('quality'))) for entry in entries),
        'causes': [
            text(effect.get('cause'))
            for entry in page.diagnoses
            for effect in rows(entry.data.get('effects'))
        ],
        'is_judged': any(is_judged(entry) for entry in page.diagnoses),
        'is_unexplained': any(
            table(entry.data.get('unexplained')).get('significant') is True
            for entry in page.diagnoses
        ),
    }


def _is_synthetic(entry: Entry) -> bool:
    experiment = table(entry.data.get('experiment'))
    told = (
        entry.data.get('case_id'),
        entry.data.get('notes'),
        experiment.get('case_id'),
        experiment.get('notes'),
    )
    return any(SYNTHETIC.search(text(part)) for part in told)


def _weakest(page: Page) -> tuple[float, str, str] | None:
    """Return the lowest correlation in time, its channel and its recording."""
    found = [
        (value, channel, entry.label)
        for entry in page.recordings
        for channel, scores in table(entry.data['channels']).items()
        if (value := number(table(scores).get('r_time'))) is not None
    ]
    return min(found, default=None)


SECTION = Section('summary', 'Summary', context)
