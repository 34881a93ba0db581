"""Run the twin beside recordings: synchronise, compare channel by channel, say how good it is."""

import argparse
from collections.abc import Mapping
from typing import Any

from escalator_twin.cli.options import add_machine, check_bags
from escalator_twin.cli.output import Document
from escalator_twin.cli.progress import ProgressLine

COLUMNS = ('r_time', 'ceiling_r_time', 'r_freq', 'nrmse', 'lag_s', 'ripple_r', 'ripple_ceiling')


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the verb's own arguments."""
    parser.add_argument(
        'bags', metavar='BAG', nargs='+', help='a rosbag2 directory or a file of it'
    )
    add_machine(parser)


def run(args: argparse.Namespace) -> Document:
    """Compare."""
    file, _ = check_bags(args.bags, args.machine)
    import escalator_twin.pipeline as pipeline

    with ProgressLine() as progress:
        return pipeline.compare(
            paths=args.bags,
            machine_path=file,
            seed=args.seed,
            jobs=args.jobs,
            progress=progress,
        )


def show(document: Document) -> str:
    """Return a table for each recording."""
    lines: list[str] = []
    for recording in document['recordings']:
        lines += [*_head(recording), _row('channel', COLUMNS)]
        for channel, values in recording['channels'].items():
            lines.append(_row(channel, [_number(values.get(name)) for name in COLUMNS]))
        for finding in recording.get('quality', ()):
            mended = ' (repaired)' if finding['repaired'] else ''
            lines.append(f'  {finding["kind"]} {finding["channel"]}: {finding["detail"]}{mended}')
        lines.append('')
    return '\n'.join(lines)


def _head(recording: Mapping[str, Any]) -> list[str]:
    speed = recording['speed_m_s']
    way = {1: 'up', -1: 'down'}.get(recording['direction'], '?')
    return [
        f'{recording["path"]}  {recording["case_id"] or ""}'.rstrip(),
        f'  {way}, {_number(speed["value"])} m/s (set {_number(recording["set_speed_m_s"])}), '
        f'axle 0 starts at {_number(recording["start_s_m"])} m, '
        f'clock {_number(recording["clock"]["offset_s"])} s '
        f'{_number(recording["clock"]["drift_ppm"], 1)} ppm',
    ]


def _row(name: str, cells: Any) -> str:
    return f'  {name:<24}' + ''.join(f'{cell:>16}' for cell in cells)


def _number(value: float | None, digits: int = 4) -> str:
    return '-' if value is None else f'{value:.{digits}f}'
