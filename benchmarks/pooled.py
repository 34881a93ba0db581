"""Rates over all unseen sets of docs/figures.md, pooled.

    python -m benchmarks.pooled [docs/figures.md] [--since SEED]

Reads the table of sets and adds up its counts: prints one row a bar, with the 95 % interval by
Clopper and Pearson. Each set was judged by the code of its day.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path
import re

from benchmarks.scoring import Rate

COUNT = re.compile(r'(\d+) of (\d+)')
# Columns of the table, from 0 on, and what their counts are of.
REFERENCE, CLEAN, UNLISTED, THIRD, SIZES = 2, 3, 4, 5, 6
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


def main() -> int:
    """Print the pooled rates."""
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    parser.add_argument('page', type=Path, nargs='?', default=Path('docs/figures.md'))
    parser.add_argument('--since', default=SINCE, help='first seed, by the order of the page')
    args = parser.parse_args()
    rows = list(rows_of(args.page.read_text(encoding='utf-8')))
    seeds = [row[0].split(',')[0] for row in rows]
    if args.since not in seeds:
        parser.error(f'--since: expected one of {", ".join(seeds)}, found {args.since}')
    rows = rows[: seeds.index(args.since) + 1]  # the newest come first
    print(f'{len(rows)} sets, {seeds[0]} back to {args.since}')
    for line in lines_of(rows):
        print(line)
    return 0


if __name__ == '__main__':
    raise SystemExit(main())
