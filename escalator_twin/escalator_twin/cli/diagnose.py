"""Name what is wrong with a machine from its recordings, and extend its model."""

import argparse

from escalator_twin.cli.options import add_machine, check_bags
from escalator_twin.cli.output import Document
from escalator_twin.cli.progress import ProgressLine


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the verb's own arguments."""
    parser.add_argument('bags', metavar='BAG', nargs='+', help='recordings of one machine')
    add_machine(parser)


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
        )


def show(document: Document) -> str:
    """Return the accepted causes, strongest first."""
    return ''.join(
        f'{effect["cause"]} {effect["location"]} p={effect["probability"]:.2f}\n'
        for effect in document['effects']
    )
