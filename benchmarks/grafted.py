"""``python -m benchmarks.grafted``: instruments' faults laid on recordings of other makers.

A fault of the measurement is drawn and laid on a recording whose labels are known; what is wrong
with its machine stays in it, so that a labelled recording becomes one with two effects.
``escalator-twin diagnose`` gets each by itself; the truth is read when all verdicts are written.
"""

import argparse
from collections.abc import Sequence
from dataclasses import asdict
import json
from pathlib import Path
import random
import sys
from typing import Any

import numpy as np
import yaml

from benchmarks.diagnosis import diagnose_all, recordings, REFERENCE, THIRD
from benchmarks.measure import MACHINE, ROOT
from benchmarks.several import figures_together, score_together, told

sys.path.append(str(ROOT / 'tests'))  # of the generator

from rig.bagfile import write_bag
from rig.catalogue import draw_effect, KINDS, SHARES
from rig.faults import FAULTS
from rig.graft import graft
from rig.measured import read_recording


def draw_grafts(
    bags: Sequence[Path], per_bag: int, causes: Sequence[str], seed: int
) -> list[tuple[Path, str]]:
    """Return which fault is laid on which recording, in mixed order; each cause about as often."""
    draw = random.Random(seed)
    names: list[str] = []
    while len(names) < per_bag * len(bags):
        names += draw.sample(list(causes), len(causes))
    pairs = [(bag, names.pop()) for bag in bags for _ in range(per_bag)]
    draw.shuffle(pairs)
    return pairs


def write_grafts(
    pairs: Sequence[tuple[Path, str]],
    labels: dict[str, list[dict[str, Any]]],
    size: str,
    seed: int,
    out: Path,
) -> None:
    """Make the recordings in ``out``, with a manifest and the truth apart."""
    (out / 'truth').mkdir(parents=True)
    rows = []
    for k, (bag, cause) in enumerate(pairs):
        rng = np.random.default_rng([seed, k])
        effect = draw_effect(rng, cause, SHARES[size] if KINDS[cause].has_size else 1.0)
        name = f'machine_{k:03d}_0'
        write_bag(graft(read_recording(bag), effect, rng), out / name)
        truth = {'bag': bag.name, 'size': size, 'effects': [*labels[bag.name], asdict(effect)]}
        (out / 'truth' / f'{name}.json').write_text(json.dumps(truth) + '\n')
        rows.append({'name': f'machine_{k:03d}', 'recordings': [name]})
    manifest = {'schema': 'rig/manifest/1', 'seed': seed, 'machines': rows}
    (out / 'manifest.json').write_text(json.dumps(manifest, indent=1) + '\n')


def parser() -> argparse.ArgumentParser:
    """Return the command line's parser."""
    root = argparse.ArgumentParser(prog='benchmarks.grafted', description=__doc__)
    root.add_argument('labels', type=Path, help='labels.yaml, the labelled recordings beside it')
    root.add_argument('--n', type=int, default=1, help='faults laid on each, one at a time')
    root.add_argument('--causes', nargs='*', choices=list(FAULTS), default=list(FAULTS))
    root.add_argument('--size', choices=(REFERENCE, THIRD), default=REFERENCE)
    root.add_argument('--seed', type=int, required=True, help='one that nobody developed with')
    root.add_argument('--out', type=Path, required=True, help='a folder for bags and verdicts')
    root.add_argument('--machine', type=Path, default=MACHINE)
    root.add_argument('--jobs', type=int, default=1, help='recordings at once')
    root.add_argument('--cores', type=int, default=2, help='shared among them')
    root.add_argument('--keep', action='store_true', help='take over bags and verdicts left there')
    return root


def main() -> int:
    """Make, diagnose, score; one JSON line for each recording and each bar."""
    given = parser().parse_args()
    out: Path = given.out
    if not (given.keep and (out / 'manifest.json').exists()):
        labels = yaml.safe_load(given.labels.read_text(encoding='utf-8'))
        bags = [given.labels.parent / name for name in labels]
        pairs = draw_grafts(bags, given.n, given.causes, given.seed)
        write_grafts(pairs, labels, given.size, given.seed, out)
    spent = []
    for row in diagnose_all(
        recordings(out), out / 'verdicts', given.machine, given.jobs, given.cores, given.keep
    ):
        spent.append(row)
        print(json.dumps(row), file=sys.stderr, flush=True)
    outcomes = score_together(out, spent)
    for row, outcome in zip(spent, outcomes, strict=True):
        print(json.dumps(told(row['name'], outcome)))
    for figure in figures_together(outcomes, 1):
        print(json.dumps({'benchmark': 'grafted', 'seed': given.seed, **figure}))
    return 0


if __name__ == '__main__':
    sys.exit(main())
