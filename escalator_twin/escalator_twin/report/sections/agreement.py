"""Recordings by channels: how well the twin agrees, at a glance."""

from escalator_twin.report.channels import union
from escalator_twin.report.documents import Page, table
from escalator_twin.report.scores import CEILINGS, SCORES, share
from escalator_twin.report.section import Context, Section

OPEN = ('r_time', 'ripple_r')  # tables that are open at first


def context(page: Page) -> Context | None:
    """Return one table a metric, for several recordings; what the metrics mean, for one."""
    if not page.recordings:
        return None
    channels = union([list(entry.data['channels']) for entry in page.recordings])
    first = page.recordings[0].data['channels']
    return {
        'recordings': page.recordings,
        'channels': channels,
        'scores': list(SCORES.values()),
        'scores_of': SCORES,
        'table': first,
        'shares': {
            name: share(scores, 'ripple_r', 'ripple_ceiling') for name, scores in first.items()
        },
        'ceilings': CEILINGS,
        'is_open': OPEN,
        'cells': {
            score.key: [
                [table(entry.data['channels'].get(channel)) for channel in channels]
                for entry in page.recordings
            ]
            for score in SCORES.values()
        },
    }


SECTION = Section('agreement', 'Agreement', context)
