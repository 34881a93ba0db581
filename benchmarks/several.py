"""``python -m benchmarks.several``: machines in which more than one thing is wrong.

Two or three causes are hidden at once, in one recording of a machine or in all sixteen experiments
of it, by the independent generator in ``tests/rig``. All recordings of a machine go to one
``escalator-twin diagnose``; the truth is read when all verdicts are written.
"""

import argparse
from collections.abc import Sequence
from contextlib import redirect_stdout
import json
from math import isnan
from pathlib import Path
import sys
from typing import Any

from benchmarks.diagnosis import diagnose, REFERENCE, THIRD
from benchmarks.figures import of_largest, of_median, of_rate, Row
from benchmarks.measure import MACHINE, ROOT
from benchmarks.scoring import judge_together, Together, Truth

sys.path.append(str(ROOT / 'tests'))  # of the generator

from rig.catalogue import LISTED
from rig.hidden import plan, write_hidden

LIMIT_S = 1800.0  # of one recording; of several as many times
SIZE = 0.10  # issue 7: within ten percent


def figures_together(outcomes: Sequence[Together], recordings: int) -> list[Row]:
    """Return one row for every bar of issue 7 that truths decide."""
    all_right = [all(o.right) for o in outcomes]
    exact = [
        all(o.right) and not o.others and all(isnan(e) or e <= SIZE for e in o.errors)
        for o in outcomes
    ]
    known = [e for o in outcomes for e in o.errors if not isnan(e)]
    is_campaign = recordings > 1
    return [
        of_rate('all_named', all_right, least=None if is_campaign else 0.70),
        of_rate('each_named', [hit for o in outcomes for hit in o.right]),
        of_rate('others_named', [bool(o.others) for o in outcomes]),
        of_rate(
            'all_named_within_10_percent_and_nothing_else',
            exact,
            least=1.0 if is_campaign else None,
        ),
        of_median('size_error', known),
        of_largest(
            'seconds', [o.seconds for o in outcomes], below=900.0 if is_campaign else 120.0
        ),
    ]


def told(name: str, outcome: Together) -> dict[str, Any]:
    """Return one machine's line."""
    return {
        'machine': name,
        'hidden': [t.cause for t in outcome.truths],
        'right': list(outcome.right),
        'size_errors': [None if isnan(e) else round(e, 4) for e in outcome.errors],
        'others': list(outcome.others),
        'failed': outcome.failed,
        'seconds': outcome.seconds,
    }


def score_together(out: Path, spent: Sequence[dict[str, Any]]) -> list[Together]:
    """Read truths and verdicts of a set whose recordings are all diagnosed."""
    outcomes = []
    for row in spent:
        truth = json.loads((out / 'truth' / f'{row["name"]}.json').read_text(encoding='utf-8'))
        verdict = None
        if 'status' not in row:
            verdict = json.loads((out / 'verdicts' / f'{row["name"]}.json').read_text('utf-8'))
        outcomes.append(judge_together(Truth.all_of(truth), verdict, row['seconds']))
    return outcomes


def parser() -> argparse.ArgumentParser:
    """Return the command line's parser."""
    root = argparse.ArgumentParser(prog='benchmarks.several', description=__doc__)
    root.add_argument('--n', type=int, default=10, help='machines')
    root.add_argument('--effects', type=int, default=2, help='hidden in each')
    root.add_argument('--recordings', type=int, default=1, help='of each; 16: all experiments')
    root.add_argument('--causes', nargs='*', choices=list(LISTED), help='drawn from (all listed)')
    root.add_argument('--sizes', nargs='+', choices=(REFERENCE, THIRD), default=[REFERENCE])
    root.add_argument('--seed', type=int, required=True, help='one that nobody developed with')
    root.add_argument('--out', type=Path, required=True, help='a folder for bags and verdicts')
    root.add_argument('--machine', type=Path, default=MACHINE)
    root.add_argument('--cores', type=int, default=2)
    root.add_argument('--keep', action='store_true', help='take over the bags left there')
    return root


def main() -> int:
    """Make, diagnose, score; one JSON line for each machine and each bar."""
    given = parser().parse_args()
    out: Path = given.out
    plans = [
        plan(k, given.seed, given.recordings, given.causes, tuple(given.sizes), given.effects)
        for k in range(given.n)
    ]
    with redirect_stdout(sys.stderr):  # standard output is for the lines of JSON
        write_hidden(plans, given.seed, out, given.cores, given.keep)
    manifest = json.loads((out / 'manifest.json').read_text(encoding='utf-8'))
    folder = out / 'verdicts'
    folder.mkdir(parents=True, exist_ok=True)
    spent = []
    for row in manifest['machines']:
        bags = [out / name for name in row['recordings']]
        spent.append(diagnose(bags, folder, given.machine, given.cores, LIMIT_S * len(bags)))
        print(json.dumps(spent[-1]), file=sys.stderr, flush=True)
    outcomes = score_together(out, spent)
    for row, outcome in zip(spent, outcomes, strict=True):
        print(json.dumps(told(row['name'], outcome)))
    for figure in figures_together(outcomes, given.recordings):
        print(json.dumps({'benchmark': 'several', 'seed': given.seed, **figure}))
    return 0


if __name__ == '__main__':
    sys.exit(main())
