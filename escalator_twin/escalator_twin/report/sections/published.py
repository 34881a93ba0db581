"""The published validation beside this one."""

from escalator_twin.report.documents import Page
from escalator_twin.report.factors import means
from escalator_twin.report.published import FIGURES, SPEED, speed_error, values
from escalator_twin.report.section import Context, Section


def context(page: Page) -> Context | None:
    """Return the published figures beside the means over the page's recordings."""
    lines = []
    for figure in FIGURES:
        found = {
            f'{entry.key} {channel}': value
            for entry in page.recordings
            for channel, value in values(figure, entry.data).items()
        }
        if found:
            lines.append((figure, means(found)))
    if not lines:
        return None
    errors = {entry.key: speed_error(entry.data) for entry in page.recordings}
    sizes = {key: None if error is None else abs(error) for key, error in errors.items()}
    return {'lines': lines, 'speed': (SPEED, means(sizes)), 'n': len(page.recordings)}


SECTION = Section('published', 'Beside the published validation', context)
