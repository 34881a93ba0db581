"""Run the twin and write what its instruments read as a rosbag2 directory."""

import argparse

from escalator_twin import bagfile
from escalator_twin.case import parse_case
from escalator_twin.cli.options import add_machine, machine_path, positive
from escalator_twin.cli.output import Document
from escalator_twin.cli.progress import ProgressLine
from escalator_twin.machine import load_machine


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the verb's own arguments."""
    add_machine(parser)
    parser.add_argument(
        '--case',
        metavar='CASE',
        help='speed=0.5,direction=up,load=75,preload=3000 (m/s, up or down, kg a step, N), or a '
        'YAML file with these keys, where load may be a list; the rest is as the machine says',
    )
    parser.add_argument(
        '--duration', metavar='S', type=positive, required=True, help='of the recording, s'
    )
    parser.add_argument(
        '--start-s',
        metavar='X',
        type=float,
        default=0.0,
        help='path coordinate of axle 0 at the start, m (%(default)s)',
    )
    parser.add_argument('--out', metavar='DIR', required=True, help='directory to make')
    parser.add_argument(
        '--instruments',
        choices=('ideal', 'real'),
        default='ideal',
        help='real: with the noise, zeros and clocks of the data sheet (%(default)s)',
    )
    parser.add_argument('--model', help='formulation of the model; unknown ones are told')


def run(args: argparse.Namespace) -> Document:
    """Simulate."""
    file = machine_path(args.machine)
    machine = load_machine(file)
    experiment = parse_case(args.case, machine)
    bagfile.check_target(args.out)
    import escalator_twin.pipeline as pipeline

    with ProgressLine() as progress:
        return pipeline.simulate_to_bag(
            machine_path=file,
            experiment=experiment,
            duration_s=args.duration,
            start_s=args.start_s,
            out=args.out,
            instruments=args.instruments,
            seed=args.seed,
            model=args.model,
            progress=progress,
        )


def show(document: Document) -> str:
    """Return what was simulated."""
    lines = [f'{key}: {value}' for key, value in document.items() if not isinstance(value, dict)]
    return '\n'.join(lines) + '\n'
