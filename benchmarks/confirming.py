"""``python -m benchmarks.confirming``: what each recording makes of effects whose true sizes it is told.

What `diagnose` does with the recordings of a campaign that are not searched in full, one by one, on a
set that ``python -m benchmarks.several`` has made (synthetic): its truths are read first, so that
nothing here is a verdict. It tells how far off the sizes of one recording are by the twin's error and
the fit of the tolerances alone, and whether their intervals know it.
"""

import argparse
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
import json
from pathlib import Path
import sys
import time
from typing import Any

from benchmarks.figures import of_largest, of_median, of_rate, Row
from benchmarks.measure import MACHINE
from escalator_twin import bagfile
from escalator_twin.causes.registry import KNOWN
from escalator_twin.diagnosis.confirm import confirm_recording
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.search_whole import LIKE_KNOBS
from escalator_twin.diagnosis.settling import OWN, TREADS
from escalator_twin.diagnosis.verdict import neutral_of
from escalator_twin.machine import load_machine

INTERVAL_SD = 1.96  # an interval of 95 %


def named(effects: Sequence[dict[str, Any]]) -> list[Proposal]:
    """Return the effects of a truth as a campaign's scouts would name them, the sizes right.

    Raises
    ------
    ValueError
        On an effect with a phase that is no tread's: how it stood is not in a truth.
    """
    found = []
    for effect in effects:
        cause = effect['cause']
        known = {p.name for p in KNOWN[cause].parameters}
        numbers = {k: v for k, v in effect['parameters'].items() if k in known - set(OWN)}
        fitted = tuple(numbers)
        if cause in TREADS:
            numbers, fitted = {**numbers, **dict.fromkeys(OWN, 0.0)}, (*fitted, *OWN)
        elif known & set(OWN):
            raise ValueError(f'{cause}: its phase in a recording is not in the truth')
        knob, _ = LIKE_KNOBS.get(cause, (None, ''))
        found.append(
            Proposal(cause, effect['location'], numbers, 0.0, fitted=fitted, nuisance=knob)
        )
    return found


def confirmed(name: str, out: Path, machine_file: Path) -> dict[str, Any]:
    """Return one recording's line."""
    truth = json.loads((out / 'truth' / f'{name}.json').read_text(encoding='utf-8'))
    machine = load_machine(machine_file)
    effects = named(truth['effects'])
    recording = bagfile.read(out / name, machine)
    start = time.perf_counter()
    found = confirm_recording(recording, machine, effects)
    rows = []
    for true, own, sd in zip(effects, found.effects, found.sd, strict=True):
        key = true.fitted[0]
        whole = true.parameters[key] - neutral_of(true.cause, key)
        off = (own.parameters[key] - true.parameters[key]) / whole
        rows.append({
            'cause': true.cause, 'parameter': key, 'off': round(off, 4),
            'sd': round(abs(sd.get(key, 0.0) / whole), 4),
        })  # fmt: skip
    return {
        'recording': name,
        'effects': rows,
        'flagged': bool(found.unexplained.significant),
        'share': round(found.unexplained.share, 4),
        'seconds': round(time.perf_counter() - start, 1),
    }


def figures_of(lines: Sequence[dict[str, Any]]) -> Iterator[Row]:
    """Return the rows over all recordings, and the errors of each cause."""
    rows = [row for line in lines for row in line['effects']]
    for cause in sorted({row['cause'] for row in rows}):
        own = [row for row in rows if row['cause'] == cause]
        yield {**of_median('size_error', [abs(row['off']) for row in own]), 'cause': cause}
        least, most = (f([row['off'] for row in own]) for f in (min, max))
        yield {'name': 'size_off_from_to', 'value': [least, most], 'cause': cause}
    yield of_rate('intervals_hold', [abs(r['off']) <= INTERVAL_SD * r['sd'] for r in rows])
    yield of_rate('flagged', [line['flagged'] for line in lines])
    yield of_largest('share_left_open', [line['share'] for line in lines])
    yield of_median('seconds', [line['seconds'] for line in lines])
    yield of_largest('seconds_at_most', [line['seconds'] for line in lines])


def parser() -> argparse.ArgumentParser:
    """Return the command line's parser."""
    root = argparse.ArgumentParser(prog='benchmarks.confirming', description=__doc__)
    root.add_argument('out', type=Path, help='the folder of a set of benchmarks.several')
    root.add_argument('--machine', type=Path, default=MACHINE)
    root.add_argument('--jobs', type=int, default=2, help='recordings at a time')
    root.add_argument('--only', type=int, nargs='*', help='numbers of recordings (all)')
    return root


def main() -> int:
    """Confirm every recording; one JSON line for each and for each figure."""
    given = parser().parse_args()
    manifest = json.loads((given.out / 'manifest.json').read_text(encoding='utf-8'))
    names = [name for row in manifest['machines'] for name in row['recordings']]
    names = [name for k, name in enumerate(names) if given.only is None or k in given.only]
    lines = []
    with ProcessPoolExecutor(given.jobs) as pool:
        for line in pool.map(partial(confirmed, out=given.out, machine_file=given.machine), names):
            lines.append(line)
            print(json.dumps(line), flush=True)
    for row in figures_of(lines):
        print(json.dumps({'benchmark': 'confirming', **row}))
    return 0


if __name__ == '__main__':
    sys.exit(main())
