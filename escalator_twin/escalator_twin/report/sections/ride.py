"""Ride quality of the step, measured beside simulated."""

from escalator_twin.report.documents import Entry, number, Page, table
from escalator_twin.report.section import Context, Section

AXES = ('x', 'y', 'z')
FIGURES = ('rms', 'max_running_rms', 'a95_peak_to_peak', 'comfort_max_running_rms')


def context(page: Page) -> Context | None:
    """Return one row a recording and axis, where a step's acceleration was judged."""
    rows = [row for entry in page.recordings for row in _rows(entry)]
    if not rows:
        return None
    applies = [table(e.data.get('ride_quality')).get('applies') for e in page.recordings]
    return {'rows': rows, 'applies': next((str(text) for text in applies if text), '')}


def _rows(entry: Entry) -> list[Context]:
    ride = table(entry.data.get('ride_quality'))
    sides = {side: table(ride.get(side)) for side in ('measured', 'simulated')}
    return [
        {
            'entry': entry,
            'axis': axis,
            'passes': number(table(sides['measured'].get(axis)).get('n_passes')),
            'values': [
                [number(table(sides[side].get(axis)).get(name)) for side in sides]
                for name in FIGURES
            ],
        }
        for axis in AXES
        if table(sides['measured'].get(axis)) or table(sides['simulated'].get(axis))
    ]


SECTION = Section('ride', 'Ride quality of the step', context)
