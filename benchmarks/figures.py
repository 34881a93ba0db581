"""The bars of issues 6 and 7 over many outcomes, as rows of JSON and as Markdown."""

from collections.abc import Callable, Iterator, Sequence
from statistics import median
from typing import Any

from benchmarks.rates import calibration, Rate
from benchmarks.scoring import (
    CLEAN,
    confusion,
    LISTED,
    NOT_LISTED,
    NOTHING,
    Outcome,
)

Row = dict[str, Any]
SMALL = 'third'
LEAST_OF_A_CAUSE = 0.60
HALF = 0.5  # issue 7: of the amplitude above the floor, at the reference


def figures(outcomes: Sequence[Outcome]) -> list[Row]:
    """Return one row for every bar: its value, interval, trials, and whether it is met.

    A cause without a size counts among those at the reference.
    """
    listed = [o for o in outcomes if o.truth.kind == LISTED]
    large = [o for o in listed if o.truth.size != SMALL]
    small = [o for o in listed if o.truth.size == SMALL]
    clean = [o for o in outcomes if o.truth.kind == CLEAN]
    foreign = [o for o in outcomes if o.truth.kind == NOT_LISTED]
    return [
        of_rate('cause_first', [o.cause_right for o in large], least=0.90),
        of_rate('place_too', [o.place_right for o in large], least=0.85),
        least_cause(large),
        of_rate('named_on_clean', [o.named != NOTHING or o.failed for o in clean], most=0.02),
        of_rate('unlisted_flagged', [o.abstained and o.flagged for o in foreign], least=0.80),
        of_rate('unlisted_named', [o.named != NOTHING or o.failed for o in foreign]),
        of_median('size_error', [e for o in large for e in o.size_errors], below=0.05),
        of_median('size_error_over_value', [e for o in large for e in o.value_errors]),
        of_rate(
            'intervals_hold', [hit for o in listed for hit in o.covered], least=0.90, most=0.98
        ),
        of_calibration(outcomes),
        of_rate(
            'third_right_or_abstaining', [o.cause_right or o.abstained for o in small], least=0.95
        ),
        of_rate('third_right', [o.cause_right for o in small], least=0.60),
        *of_gains(large),
        of_median('seconds', [o.seconds for o in outcomes]),
        of_largest('seconds_at_most', [o.seconds for o in outcomes], below=120.0),
        {'name': 'no_verdict', 'value': sum(o.failed for o in outcomes), 'trials': len(outcomes)},
    ]


def of_gains(outcomes: Sequence[Outcome]) -> list[Row]:
    """Return how often a right name's gain on held-out samples is significant, and halves what is left."""
    gains = [o.gain for o in outcomes if o.gain is not None]
    left = [g.left_over for g in gains if g.left_over is not None]
    return [
        of_rate('gain_significant', [g.significant for g in gains], least=1.0),
        of_rate('left_over_halved', [share <= HALF for share in left], least=1.0),
    ]


def of_rate(
    name: str, hits: Sequence[bool], least: float | None = None, most: float | None = None
) -> Row:
    """Return a share with its interval; an empty one meets no bar."""
    rate = Rate.of(hits)
    row: Row = {
        'name': name, 'value': rate.value, 'low': rate.low, 'high': rate.high,
        'hits': rate.hits, 'trials': rate.trials,
    }  # fmt: skip
    if least is None and most is None:
        return row
    bar = {key: value for key, value in (('least', least), ('most', most)) if value is not None}
    value = rate.value
    met = value is not None and (least or 0.0) <= value <= (1.0 if most is None else most)
    return {**row, 'bar': bar, 'met': met}


def of_median(name: str, values: Sequence[float], below: float | None = None) -> Row:
    """Return the median of some numbers."""
    return _of_number(name, median(values) if values else None, len(values), below)


def of_largest(name: str, values: Sequence[float], below: float | None = None) -> Row:
    """Return the largest of some numbers."""
    return _of_number(name, max(values) if values else None, len(values), below)


def _of_number(name: str, value: float | None, trials: int, below: float | None) -> Row:
    row: Row = {'name': name, 'value': value, 'trials': trials}
    if below is None:
        return row
    return {**row, 'bar': {'below': below}, 'met': value is not None and value < below}


def of_calibration(outcomes: Sequence[Outcome]) -> Row:
    """Return the expected calibration error with its bins."""
    found = calibration([o.belief for o in outcomes if o.belief is not None])
    row = _of_number('calibration_error', found.error, sum(r[2] for r in found.rows), 0.07)
    return {**row, 'bins': [list(one) for one in found.rows]}


def least_cause(outcomes: Sequence[Outcome]) -> Row:
    """Return the worst cause's share of right names."""
    rows = [row for row in by_cause(outcomes) if row['cause']['trials']]
    worst = min(rows, key=lambda row: row['cause']['value'], default=None)
    if worst is None:
        return of_rate('least_cause', [], least=LEAST_OF_A_CAUSE)
    row = {k: worst['cause'][k] for k in ('value', 'low', 'high', 'hits', 'trials')}
    return {
        'name': 'least_cause', 'which': worst['name'], **row,
        'bar': {'least': LEAST_OF_A_CAUSE}, 'met': row['value'] >= LEAST_OF_A_CAUSE,
    }  # fmt: skip


def by_cause(outcomes: Sequence[Outcome]) -> list[Row]:
    """Return what every hidden cause came to."""
    names = sorted({o.truth.cause or CLEAN for o in outcomes})
    rows = []
    for name in names:
        own = [o for o in outcomes if (o.truth.cause or CLEAN) == name]
        errors = [e for o in own for e in o.size_errors]
        rows.append({
            'name': name,
            'cause': of_rate('cause', [o.cause_right for o in own]),
            'place': of_rate('place', [o.place_right for o in own]),
            'abstained': of_rate('abstained', [o.abstained for o in own]),
            'flagged': of_rate('flagged', [o.flagged for o in own]),
            'size_error': median(errors) if errors else None,
            'holds': of_rate('holds', [hit for o in own for hit in o.covered]),
        })  # fmt: skip
    return rows


def markdown(outcomes: Sequence[Outcome]) -> str:
    """Return the bars, the causes and the confusion as Markdown."""
    parts = [
        '## Bars',
        '',
        '| what | value | 95 % | of | bar | met |',
        '|---|---|---|---|---|---|',
    ]
    parts += [_line(_bar_cells(row)) for row in figures(outcomes)]
    for title, chosen in _groups(outcomes):
        if chosen:
            parts += ['', f'## {title}', '', *_cause_table(chosen)]
    parts += ['', '## Named, by what was hidden', '', '| hidden | named |', '|---|---|']
    parts += [
        _line([name, ', '.join(f'{key} {count}' for key, count in row.items())])
        for name, row in confusion(outcomes).items()
    ]
    return '\n'.join(parts) + '\n'


def _groups(outcomes: Sequence[Outcome]) -> Iterator[tuple[str, list[Outcome]]]:
    kinds: tuple[tuple[str, Callable[[Outcome], bool]], ...] = (
        ('Causes at the reference', lambda o: o.truth.kind == LISTED and o.truth.size != SMALL),
        ('Causes at a third of it', lambda o: o.truth.kind == LISTED and o.truth.size == SMALL),
        ('On no list, and within tolerance', lambda o: o.truth.kind != LISTED),
    )
    for title, wanted in kinds:
        yield title, [o for o in outcomes if wanted(o)]


def _cause_table(outcomes: Sequence[Outcome]) -> Iterator[str]:
    yield '| hidden | cause | place | nothing named | flagged | size error | intervals hold |'
    yield '|---|---|---|---|---|---|---|'
    for row in by_cause(outcomes):
        error = row['size_error']
        rates = [_share(row[key]) for key in ('cause', 'place', 'abstained', 'flagged')]
        yield _line([row['name'], *rates, _number(error), _share(row['holds'])])


def _share(row: Row) -> str:
    """Return hits, trials and interval of a rate."""
    if not row['trials']:
        return ''
    return f'{row["hits"]}/{row["trials"]} ({row["low"]:.2f} to {row["high"]:.2f})'


def _bar_cells(row: Row) -> list[str]:
    bar = ', '.join(f'{key} {value:g}' for key, value in row.get('bar', {}).items())
    interval = f'{row["low"]:.3f} to {row["high"]:.3f}' if 'low' in row else ''
    met = {True: 'yes', False: 'no'}.get(row.get('met'), '')
    name = f'{row["name"]} ({row["which"]})' if 'which' in row else row['name']
    return [name, _number(row['value']), interval, str(row['trials']), bar, met]


def _number(value: float | None) -> str:
    return '' if value is None else f'{value:.3g}'


def _line(cells: Sequence[str]) -> str:
    return f'| {" | ".join(cells)} |'
