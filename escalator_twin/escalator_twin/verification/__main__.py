"""``python -m escalator_twin.verification [PART...] [--plots FOLDER]``: docs/verification.md again.

``--recordings BAG...`` names recordings of good machines by another program, for the part of that name.

Prints every figure beside its bar, ``+`` where it holds and ``!`` where it does not; the exit
status is 1 where one does not.
"""

import argparse
from importlib import import_module
from pathlib import Path
import sys

from escalator_twin.machine import load_machine, machines_folder
from escalator_twin.verification.figure import Figure

PARTS = (
    'polygon_limit',
    'wheel',
    'curves',
    'statics',
    'conservation',
    'convergence',
    'symmetry',
    'gravity',
)
WITH_RECORDINGS = (*PARTS, 'recordings')
MACHINES = {'wheel': 'prototype_wheel.yaml'}


def main() -> int:
    """Print the figures of all parts, or of those that are named; write plots where asked."""
    parser = argparse.ArgumentParser(prog='python -m escalator_twin.verification')
    parser.add_argument('part', nargs='*', help=', '.join(WITH_RECORDINGS))
    parser.add_argument('--plots', type=Path, metavar='FOLDER', help='write the plots there')
    parser.add_argument(
        '--recordings', nargs='+', type=Path, default=[], metavar='BAG', help='of good machines'
    )
    arguments = parser.parse_args()
    unknown = [name for name in arguments.part if name not in WITH_RECORDINGS]
    if unknown:
        parser.error(f'{unknown[0]}: expected some of {", ".join(WITH_RECORDINGS)}')
    missed = 0
    for name in arguments.part or WITH_RECORDINGS:
        part = import_module(f'escalator_twin.verification.{name}')
        machine = load_machine(machines_folder() / MACHINES.get(name, 'prototype.yaml'))
        if arguments.plots is not None:
            write_plots(part.plots(machine) if hasattr(part, 'plots') else {}, arguments.plots)
            continue
        given = [arguments.recordings] if name == 'recordings' else []
        missed += print_figures(part.figures(machine, *given))
    return int(missed > 0)


def print_figures(figures: list[Figure]) -> int:
    """Print figures under their subjects; return how many do not hold."""
    subject = ''
    for figure in figures:
        if figure.subject != subject:
            subject = figure.subject
            print(f'\n{subject}')
        print(figure.line(), flush=True)
    return sum(not figure.holds for figure in figures)


def write_plots(plots: dict[str, str], folder: Path) -> None:
    """Write plots by file name into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in plots.items():
        (folder / name).write_text(text, encoding='utf-8')


if __name__ == '__main__':
    sys.exit(main())
