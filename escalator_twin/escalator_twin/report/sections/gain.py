"""What the extended machine gains on samples that no fit has seen."""

from escalator_twin.report.charts import dumbbells
from escalator_twin.report.documents import Entry, number, numbers, Page, table, text
from escalator_twin.report.section import Context, Section

PAIRS = (
    ('nrmse', 'NRMSE, 2 Hz', 'percent'),
    ('r_time', 'r in time', 'r'),
    ('nrmse_band', 'NRMSE, 20 Hz', 'percent'),
    ('chi2', 'χ² per sample', 'plain'),
)


def context(page: Page) -> Context | None:
    """Return a table a diagnosis: each channel before and after."""
    gains = [_gain(entry) for entry in page.diagnoses if 'gain' in entry.data]
    return {'gains': gains, 'pairs': PAIRS} if gains else None


def _gain(entry: Entry) -> Context:
    gain = table(entry.data.get('gain'))
    held_out = table(gain.get('held_out'))
    channels = {name: table(row) for name, row in table(held_out.get('channels')).items()}
    more = {key: value for key, value in gain.items() if key not in ('held_out', 'split')}
    return {
        'entry': entry,
        'split': text(held_out.get('split')) or text(gain.get('split')),
        'blocks': number(held_out.get('blocks')),
        'interval': _interval(held_out.get('gain_interval')),
        'is_significant': held_out.get('significant'),
        'is_named': bool(entry.data.get('effects')),
        'worse': _names(held_out.get('worse')),
        'channels': channels,
        'chart': dumbbells(
            [
                (name, number(row.get('nrmse_band_before')), number(row.get('nrmse_band_after')))
                for name, row in channels.items()
            ]
        ),
        'more': more,
    }


def _interval(value: object) -> tuple[float, float] | None:
    """Return the ends of the gain's interval, relative fall of the squared residual."""
    ends = numbers(value)
    if len(ends) != 2 or ends[0] is None or ends[1] is None:
        return None
    return ends[0], ends[1]


def _names(value: object) -> list[str]:
    return [name for name in value if isinstance(name, str)] if isinstance(value, list) else []


SECTION = Section('gain', 'Gain on held-out data', context)
