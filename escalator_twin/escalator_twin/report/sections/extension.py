"""The extended machine as the simulator reads it, and the way there and back."""

from escalator_twin.report.documents import Entry, Page, rows, table, text
from escalator_twin.report.section import Context, Section


def context(page: Page) -> Context | None:
    """Return each diagnosis's extended machine, its description where the document has it."""
    extended = [_extension(entry) for entry in page.diagnoses if _path(entry)]
    return {'extended': extended} if extended else None


def _path(entry: Entry) -> str:
    return text(entry.data.get('extended_machine'))


def _extension(entry: Entry) -> Context:
    return {
        'entry': entry,
        'path': _path(entry),
        'original': entry.machine,
        'yaml': text(entry.data.get('extended_machine_yaml')).rstrip('\n'),
        'case': _case(entry),
    }


def _case(entry: Entry) -> str:
    """Return the experiment of the first recording as the command line takes it."""
    for part in rows(entry.data.get('recordings')):
        experiment = table(part.get('experiment'))
        loads = experiment.get('load_per_step_kg')
        told = {
            'speed': part.get('set_speed_m_s'),
            'direction': {1: 'up', -1: 'down'}.get(_whole(part.get('direction'))),
            'load': loads[0] if isinstance(loads, list) and len(loads) == 1 else None,
            'preload': experiment.get('preload_n'),
        }
        return ','.join(
            f'{key}={value:g}' if isinstance(value, int | float) else f'{key}={value}'
            for key, value in told.items()
            if isinstance(value, int | float | str) and not isinstance(value, bool)
        )
    return ''


def _whole(value: object) -> int:
    return value if isinstance(value, int) and not isinstance(value, bool) else 0


SECTION = Section('extension', 'Extended machine', context)
