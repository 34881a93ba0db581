"""Rates over all unseen sets of docs/figures.md, pooled.

    python -m benchmarks.pooled [docs/figures.md] [--since SEED] [--causes CSV] [--beliefs CSV]

Reads the table of sets and adds up its counts: prints one row a bar, with the 95 % interval by
Clopper and Pearson, the calibration of the sets whose probabilities are kept, and one row a cause at
the reference. Each set was judged by the code of its day.
"""

import argparse
from collections.abc import Collection, Iterator
import csv
from pathlib import Path
import re

import numpy as np

from benchmarks.rates import calibration, Rate

COUNT = re.compile(r'(\d+) of (\d+)')
# Columns of the table, from 0 on, and what their counts are of.
REFERENCE, CLEAN, UNLISTED, THIRD, SIZES = 2, 3, 4, 5, 6
DRAWS = 4000  # of statements that are as right as they say
SINCE = '221101'  # the first set judged by a decision that is about today's


def rows_of(text: str) -> Iterator[list[str]]:
    """Yield the cells of each set's row."""
    for line in text.splitlines():
        if re.match(r'\| \d{4,6}, ', line):
            yield [cell.strip() for cell in line.strip().strip('|').split('|')]


def counts(cell: str) -> list[tuple[int, int]]:
    """Return every count of a cell; what is said to be the same for both is there twice."""
    found = [(int(a), int(b)) for a, b in COUNT.findall(cell)]
    return found * 2 if len(found) == 1 and ', both' in cell else found


def pooled(rows: list[list[str]], column: int, which: int = 0) -> Rate:
    """Return the rate of one column's first or second count over all rows that have it."""
    told = [found[which] for row in rows if len(found := counts(row[column])) > which]
    return Rate.of([k < hits for hits, trials in told for k in range(trials)])


def lines_of(rows: list[list[str]]) -> list[str]:
    """Return one row a bar."""
    bars = (
        ('right cause at the reference (bar 90 %)', pooled(rows, REFERENCE)),
        ('right place too (bar 85 %)', pooled(rows, REFERENCE, 1)),
        ('good machine, a cause named (bar 2 %)', pooled(rows, CLEAN)),
        ('on no list, flagged and not named (bar 80 %)', pooled(rows, UNLISTED)),
        ('right at a third (bar 60 %)', pooled(rows, THIRD)),
        ('right or abstaining at a third (bar 95 %)', pooled(rows, THIRD, 1)),
        ('95 % intervals hold the truth (bar 90 to 98 %)', pooled(rows, SIZES)),
    )
    return [
        f'| {name} | {r.hits} of {r.trials}, {100.0 * r.hits / r.trials:.1f} % '
        f'({100.0 * r.low:.0f} to {100.0 * r.high:.0f}) |'
        for name, r in bars
        if r.trials
    ]


def of_causes(page: Path, seeds: Collection[str]) -> dict[str, Rate]:
    """Return how often each cause was right at the reference, worst first, over some sets.

    A row of the page has a set's seed, a cause, how many recordings held it and in how many it was right.
    """
    hits: dict[str, list[bool]] = {}
    with page.open(encoding='utf-8', newline='') as file:
        for row in csv.DictReader(file):
            if row['seed'] in seeds:
                n, right = int(row['recordings']), int(row['right'])
                hits.setdefault(row['cause'], []).extend(k < right for k in range(n))
    rates = {cause: Rate.of(told) for cause, told in hits.items()}
    return dict(sorted(rates.items(), key=lambda r: (r[1].hits / r[1].trials, -r[1].trials, r[0])))


def lines_of_causes(rates: dict[str, Rate]) -> list[str]:
    """Return one row a cause that was missed, and one for all others together."""
    missed = {cause: r for cause, r in rates.items() if r.hits < r.trials}
    others = [r.trials for cause, r in rates.items() if cause not in missed]
    rows = [
        f'| `{cause}` | {r.hits} of {r.trials}, {100.0 * r.hits / r.trials:.0f} % '
        f'({100.0 * r.low:.0f} to {100.0 * r.high:.0f}) |'
        for cause, r in missed.items()
    ]
    if others:
        rows.append(f'| {len(others)} others | all of {min(others)} to {max(others)} each |')
    return rows


def calibration_line(page: Path) -> str:
    """Return the calibration of the statements of a page, beside what chance makes of perfect ones."""
    with page.open(encoding='utf-8', newline='') as file:
        told = [(float(row['probability']), row['right'] == '1') for row in csv.DictReader(file)]
    rng = np.random.default_rng(1)
    drawn = rng.random((DRAWS, len(told))) < np.array([p for p, _ in told])
    perfect = [
        calibration([(p, bool(hit)) for (p, _), hit in zip(told, row, strict=True)]).error or 0.0
        for row in drawn
    ]
    return (
        f'| calibration (bar 0.07) | {calibration(told).error:.3f} of {len(told)} statements; as many that are as right '
        f'as they say: {np.median(perfect):.3f} in the median, up to {np.quantile(perfect, 0.95):.3f} in 95 % |'
    )


def main() -> int:
    """Print the pooled rates."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('page', type=Path, nargs='?', default=Path('docs/figures.md'))
    parser.add_argument('--since', default=SINCE, help='first seed, by the order of the page')
    parser.add_argument('--causes', type=Path, default=Path('docs/figures_causes.csv'))
    parser.add_argument('--beliefs', type=Path, default=Path('docs/figures_beliefs.csv'))
    args = parser.parse_args()
    rows = list(rows_of(args.page.read_text(encoding='utf-8')))
    seeds = [row[0].split(',')[0] for row in rows]
    if args.since not in seeds:
        parser.error(f'--since: expected one of {", ".join(seeds)}, found {args.since}')
    rows = rows[: seeds.index(args.since) + 1]  # the newest come first
    print(f'{len(rows)} sets, {seeds[0]} back to {args.since}')
    for line in lines_of(rows):
        print(line)
    print(calibration_line(args.beliefs))
    print('\nby cause, at the reference (bar: each 60 %)')
    for line in lines_of_causes(of_causes(args.causes, seeds[: len(rows)])):
        print(line)
    return 0


if __name__ == '__main__':
    raise SystemExit(main())
