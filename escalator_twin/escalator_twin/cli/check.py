"""Say what is in a recording and what is wrong with it, before anything is judged."""

import argparse
from pathlib import Path
from typing import Any

from escalator_twin import bagfile
from escalator_twin.check import check
from escalator_twin.cli.options import add_machine, machine_path
from escalator_twin.cli.output import Document
from escalator_twin.machine import load_machine
from escalator_twin.suggest import suggest


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the verb's own arguments."""
    parser.add_argument('bag', metavar='BAG', help='a rosbag2 directory or a file of it')
    add_machine(parser)
    parser.add_argument(
        '--suggest',
        action='store_true',
        help="draft the machine's instruments section for this recording, as YAML to be edited",
    )


def run(args: argparse.Namespace) -> Document:
    """Check."""
    if args.suggest:
        return {
            'schema': 'escalator_twin/suggestion/1',
            'path': str(args.bag),
            'instruments': suggest(Path(args.bag)),
        }
    bagfile.topics(args.bag)  # what is wrong with the bag comes before what is with the machine
    return check(args.bag, load_machine(machine_path(args.machine)))


def show(document: Document) -> str:
    """Return the topics, the clock and the findings as text."""
    if 'instruments' in document:
        return str(document['instruments'])
    lines = [str(document['path']), '', f'  {"topic":<40}{"messages":>9}{"Hz":>9}  type']
    lines += [_topic(row) for row in document['topics']]
    lines += ['', f'  clock: {_clock(document["clock"])}']
    container = document['container']
    lines += [f'  {text}' for text in container['losses'] + container['notes']]
    count = len(document['quality'])
    lines += ['', f'  {count} finding' + 's' * (count != 1)]
    lines += [_finding(finding) for finding in document['quality']]
    return '\n'.join(lines) + '\n'


def _topic(row: dict[str, Any]) -> str:
    rate = '' if row['rate_hz'] is None else f'{row["rate_hz"]:.2f}'
    missing = '' if row['found'] else '  (missing)'
    return f'  {row["topic"]:<40}{row["n_messages"]:>9}{rate:>9}  {row["type"]}{missing}'


def _clock(clock: dict[str, Any]) -> str:
    if clock['offset_s'] is None:
        return f'unknown: {clock["reason"]}'
    return (
        f'{clock["logger"]} is {clock["offset_s"]:+.4f} s '
        f'({clock["offset_low_s"]:+.4f} to {clock["offset_high_s"]:+.4f}) off '
        f'{clock["reference"]}, and runs {clock["drift_ppm"]:+.1f} ppm '
        f'({clock["drift_low_ppm"]:+.1f} to {clock["drift_high_ppm"]:+.1f}) against it'
    )


def _finding(finding: dict[str, Any]) -> str:
    mended = ' (repaired)' if finding['repaired'] else ''
    span = f'{finding["from_s"]:.2f} to {finding["to_s"]:.2f} s'
    return f'  {finding["kind"]} {finding["channel"]} {span}: {finding["detail"]}{mended}'
