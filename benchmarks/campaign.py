"""Diagnose all recordings of one machine and write the argument as a page of text.

    python -m benchmarks.campaign BAG... --out docs/campaign.md [--json FILE] [--jobs 2]

`make campaign-diagnosis BAGS="DIR/*"` does that. With `--read FILE` the page is written from a
diagnosis that was made before.
"""

import argparse
from collections.abc import Mapping, Sequence
import json
from pathlib import Path, PurePath
import time
from typing import Any

from escalator_twin import pipeline
from escalator_twin.cli.output import dumps

HEAD = """# The campaign's machine

What is wrong with the machine of the {n} recordings, and what naming it improves. The recordings were
made by others on a virtual rig, an independent multibody program with the instrumentation's imperfections:
they are synthetic, and are not part of this repository. This page is written by

```
make campaign-diagnosis BAGS="DIR/*"
```

from the JSON of `escalator-twin diagnose` (seed {seed}, {took}). {searched} recordings were searched in full;
the sizes of what they name were fitted to {fitted}, and put beside the {others} others with nothing of it fitted to them.
"""


def number(value: float | None, digits: int = 4) -> str:
    """Return a number in few digits; a dash for none."""
    return '-' if value is None else f'{value:.{digits}g}'


def place(location: Mapping[str, Any]) -> str:
    """Return a location in words."""
    return ', '.join(f'{k} {v}' for k, v in location.items()) or '-'


def sizes(parameters: Mapping[str, Mapping[str, float]]) -> str:
    """Return numbers with their intervals."""
    return '; '.join(
        f'{name} {number(p["value"])} ({number(p["low"])} to {number(p["high"])})'
        for name, p in parameters.items()
    )


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table."""
    lines = [' | '.join(head), ' | '.join('---' for _ in head), *(' | '.join(r) for r in rows)]
    return '\n'.join(f'| {line} |' for line in lines) + '\n'


def page(document: Mapping[str, Any], seed: int, seconds: float | None) -> str:
    """Return the page of a diagnosis.

    Parameters
    ----------
    document : mapping
        The JSON of ``diagnose`` of several recordings.
    seed : int
    seconds : float, optional
        How long it took, wall time.
    """
    recordings = document['by_recording']
    searched = sum(bool(r.get('searched', True)) for r in recordings)
    fitted = sum(bool(r.get('fitted', r.get('searched', True))) for r in recordings)
    took = 'time not taken' if seconds is None else f'{seconds / 60.0:.1f} minutes of wall time'
    parts = [
        HEAD.format(
            n=len(recordings),
            seed=seed,
            took=took,
            searched=searched,
            fitted=fitted,
            others=len(recordings) - fitted,
        ),
        '## What is wrong\n',
        _effects(document['effects']),
        '## The gain on recordings that no size was fitted to\n',
        _gain(document['gain']),
        '## Recording by recording\n',
        'A size is what that recording alone would give; a probability stands where it was searched.\n',
        _recordings(recordings),
        '## What stays open\n',
        _rest(document),
    ]
    return '\n'.join(parts)


def _effects(effects: Sequence[Mapping[str, Any]]) -> str:
    if not effects:
        return 'Nothing is named.\n'
    rows = [
        [
            f'`{e["cause"]}`', place(e['location']), sizes(e['parameters']),
            f'{e["probability"]:.2f}', f'{e.get("recordings", "-")} of {e.get("of", "-")}',
            ', '.join(e['alternatives']) or '-',
        ]
        for e in effects
    ]  # fmt: skip
    head = ['cause', 'place', 'size (95 %)', 'probability', 'recordings that show it', 'or']
    return table(head, rows)


def _gain(gain: Mapping[str, Any]) -> str:
    held = gain['held_out']
    if held is None:
        return f'None: {gain["split"]}.\n'
    rows = [
        [
            f'`{name}`',
            f'{number(row["chi2_before"], 3)} to {number(row["chi2_after"], 3)}',
            f'{number(row["nrmse_band_before"], 3)} to {number(row["nrmse_band_after"], 3)}',
            f'{number(row["r_time_before"], 6)} to {number(row["r_time_after"], 6)}',
        ]
        for name, row in held['channels'].items()
    ]
    head = ['channel', 'chi squared a sample', 'nrmse, 20 Hz', 'r_time']
    low, high = held.get('gain_interval', (None, None))
    said = 'significant' if held.get('significant') else 'not significant'
    text = (
        f'{held["split"]}. Whitened residual energy falls by {number(low, 3)} to {number(high, 3)}'
    )
    worse = ', '.join(held.get('worse', [])) or 'none'
    return f'{text} (95 %, {said}); channels that become worse: {worse}.\n\n{table(head, rows)}'


def _recordings(recordings: Sequence[Mapping[str, Any]]) -> str:
    rows = []
    for row in recordings:
        name = PurePath(row['path']).name
        told = row['effects'] or [None]
        for k, effect in enumerate(told):
            rows.append([
                f'`{name}`' if k == 0 else '',
                '-' if effect is None else f'`{effect["cause"]}` {place(effect["location"])}',
                '-' if effect is None else sizes(effect['parameters']),
                '-' if effect is None else number(effect['probability'], 2),
                _share(row['unexplained']) if k == 0 else '',
            ])  # fmt: skip
    return table(['recording', 'cause', 'size (95 %)', 'probability', 'unexplained'], rows)


def _share(rest: Mapping[str, Any]) -> str:
    return f'{rest["share"]:.1%}' if rest['significant'] else 'no'


def _rest(document: Mapping[str, Any]) -> str:
    rest = document['unexplained']
    lines = []
    if rest['significant']:
        lines.append(
            f"More is left than the twin's own error and the tolerances give, in "
            f'{rest.get("recordings", 1)} recordings; the largest share of the whitened residual '
            f'energy is {rest["share"]:.1%}:\n'
        )
        lines += [f'- {key}: {value}' for key, value in rest['signature'].items()]
    else:
        lines.append("Nothing beyond what the twin's own error and the tolerances give.")
    lines += ['', *(f'- {line}' for line in document.get('would_change', []))]
    return '\n'.join(lines).rstrip() + '\n'


def main() -> None:
    """Diagnose and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('bags', nargs='*', metavar='BAG')
    parser.add_argument('--machine', default='config/machines/prototype.yaml')
    parser.add_argument('--out', type=Path, default=Path('docs/campaign.md'))
    parser.add_argument('--json', type=Path, default=Path('out/campaign_diagnosis.json'))
    parser.add_argument('--read', type=Path)
    parser.add_argument('--jobs', type=int, default=2)
    parser.add_argument('--seed', type=int, default=0)
    given = parser.parse_args()
    seconds: float | None = None
    if given.read is not None:
        document = json.loads(given.read.read_text(encoding='utf-8'))
        seconds = document.get('seconds')
    else:
        given.json.parent.mkdir(parents=True, exist_ok=True)
        start = time.monotonic()
        document = pipeline.diagnose(
            given.bags,
            given.machine,
            given.seed,
            given.jobs,
            lambda done, total: print(f'{done:.0f} of {total:.0f}', flush=True),
            given.json.with_name(f'{given.json.stem}_extended.yaml'),
        )
        seconds = time.monotonic() - start
        document = {**document, 'seconds': seconds}
        given.json.write_text(dumps(document), encoding='utf-8')
    given.out.write_text(page(document, given.seed, seconds), encoding='utf-8')
    print(given.out)


if __name__ == '__main__':
    main()
