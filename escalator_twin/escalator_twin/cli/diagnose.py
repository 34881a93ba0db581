"""Name what is wrong with a machine from its recordings, and extend its model."""

import argparse

from escalator_twin.cli.options import add_machine, check_bags
from escalator_twin.cli.output import Document
from escalator_twin.errors import NotYetError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the verb's own arguments."""
    parser.add_argument('bags', metavar='BAG', nargs='+', help='recordings of one machine')
    add_machine(parser)


def run(args: argparse.Namespace) -> Document:
    """Diagnose."""
    check_bags(args.bags, args.machine)
    raise NotYetError('diagnose: not in this version; the recordings can be read and compared')


def show(document: Document) -> str:
    """Return the accepted causes, strongest first."""
    return ''.join(
        f'{effect["cause"]} {effect["location"]} p={effect["probability"]:.2f}\n'
        for effect in document['effects']
    )
