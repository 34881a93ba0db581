"""Name what is wrong with a machine from its recordings, and extend its model."""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from escalator_twin.cli.options import add_machine, check_bags
from escalator_twin.cli.output import Document
from escalator_twin.cli.progress import ProgressLine


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the verb's own arguments."""
    parser.add_argument('bags', metavar='BAG', nargs='+', help='recordings of one machine')
    add_machine(parser)
    parser.add_argument(
        '--extended',
        metavar='YAML',
        help='where the extended machine is written (beside the JSON, else here)',
    )


def run(args: argparse.Namespace) -> Document:
    """Diagnose."""
    file, _ = check_bags(args.bags, args.machine)
    import escalator_twin.pipeline as pipeline

    with ProgressLine() as progress:
        return pipeline.diagnose(
            paths=args.bags,
            machine_path=file,
            seed=args.seed,
            jobs=args.jobs,
            progress=progress,
            out=target_of(args),
        )


def target_of(args: argparse.Namespace) -> str | None:
    """Return where the extended machine goes: as asked, or beside the JSON."""
    if args.extended:
        return str(args.extended)
    if args.json and args.json != '-':
        return str(Path(args.json).with_suffix('')) + '_extended.yaml'
    return None


def show(document: Document) -> str:
    """Return the accepted causes, strongest first, what stays open, and the gain."""
    lines = []
    for effect in document['effects']:
        place = ', '.join(f'{k} {v}' for k, v in effect['location'].items())
        sizes = ', '.join(
            f'{name} {p["value"]:.4g} ({p["low"]:.4g} to {p["high"]:.4g})'
            for name, p in effect['parameters'].items()
        )
        other = f', or {" or ".join(effect["alternatives"])}' if effect['alternatives'] else ''
        where = f' at {place}' if place else ''
        lines.append(f'{effect["cause"]}{where}: {sizes}; p {effect["probability"]:.2f}{other}')
    unplaced = [row['path'] for row in document['recordings'] if not row['place_is_certain']]
    lines += [f'{path}: its place in the loop is not certain: not judged' for path in unplaced]
    if not document['effects'] and len(unplaced) < len(document['recordings']):
        lines.append('nothing is named: within tolerance, or of no known cause')
    rest = document['unexplained']
    if rest['significant']:
        lines.append(f'unexplained: {100.0 * rest["share"]:.1f} % of the residual energy')
        lines += [f'  {key}: {value}' for key, value in rest['signature'].items()]
    elif 'within_tolerance' in rest['signature']:
        lines.append(f'within tolerance, and in the data: {rest["signature"]["within_tolerance"]}')
    held = document['gain']['held_out']
    if held is None:
        lines.append(f'gain held out: none, {document["gain"]["split"]}')
    else:
        of = '' if document['effects'] else ', of what was found and is not named'
        lines.append(f'gain held out{of}: {held["split"]}')
        lines += [
            f'  {name:<24} nrmse {_change(row, "nrmse_band", 4)}, chi2 {_change(row, "chi2", 2)}'
            for name, row in held['channels'].items()
        ]
    lines.append(f'extended machine: {document["extended_machine"]}')
    return '\n'.join(lines) + '\n'


def _change(row: Mapping[str, Any], key: str, digits: int) -> str:
    """Return a value before and after; a missing one is a dash."""
    ends = (row.get(f'{key}_before'), row.get(f'{key}_after'))
    return ' to '.join('-' if end is None else f'{end:.{digits}f}' for end in ends)
