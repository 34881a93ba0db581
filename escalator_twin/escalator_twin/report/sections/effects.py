"""The causes that a diagnosis names."""

from escalator_twin.report.charts import whisker
from escalator_twin.report.documents import (
    is_judged,
    Json,
    number,
    Page,
    rows,
    table,
    text,
    unplaced,
)
from escalator_twin.report.section import Context, Section

TOLD = ('cause', 'location', 'probability', 'alternatives', 'parameters', 'recordings', 'of')


def context(page: Page) -> Context | None:
    """Return each diagnosis with its accepted causes, strongest first."""
    if not page.diagnoses:
        return None
    return {
        'diagnoses': [
            {
                'entry': entry,
                'effects': [_effect(effect) for effect in rows(entry.data.get('effects'))],
                'n_recordings': len(rows(entry.data.get('recordings'))),
                'unplaced': unplaced(entry),
                'is_judged': is_judged(entry),
                'is_unexplained': table(entry.data.get('unexplained')).get('significant') is True,
            }
            for entry in page.diagnoses
        ]
    }


def _effect(effect: Json) -> Context:
    parameters = table(effect.get('parameters'))
    alternatives = effect.get('alternatives')
    return {
        'cause': text(effect.get('cause')),
        'location': table(effect.get('location')),
        'probability': number(effect.get('probability')),
        'alternatives': [text(a) for a in alternatives] if isinstance(alternatives, list) else [],
        'parameters': [
            (name, table(value) or {'value': value}, whisker(name, table(value)))
            for name, value in parameters.items()
        ],
        'shown_by': (number(effect.get('recordings')), number(effect.get('of'))),
        'more': {key: value for key, value in effect.items() if key not in TOLD},
    }


SECTION = Section('effects', 'Named causes', context)
