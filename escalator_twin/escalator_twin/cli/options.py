"""Options that every verb takes, and what its arguments mean."""

import argparse
from collections.abc import Iterable
import os
from pathlib import Path
import sys

from escalator_twin import bagfile
from escalator_twin.cli.output import Rule
from escalator_twin.errors import EscalatorError, RecordingError
from escalator_twin.machine import load_machine, Machine

DEFAULT_MACHINE = 'config/machines/prototype.yaml'


def n_cores() -> int:
    """Return how many processor cores this process may use."""
    return (
        len(os.sched_getaffinity(0)) if hasattr(os, 'sched_getaffinity') else os.cpu_count() or 1
    )


def rule(text: str) -> Rule:
    """Read a rule; the parser turns the error into its own."""
    try:
        return Rule.parse(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def positive(text: str) -> float:
    """Read a number above zero."""
    value = float(text)
    if not 0.0 < value < float('inf'):
        raise argparse.ArgumentTypeError(f'expected a number above 0, found {text!r}')
    return value


def count(text: str) -> int:
    """Read a whole number of at least one."""
    value = int(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f'expected 1 or more, found {text!r}')
    return value


def seed(text: str) -> int:
    """Read a whole number of at least zero."""
    value = int(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f'expected 0 or more, found {text!r}')
    return value


def add_common(parser: argparse.ArgumentParser) -> None:
    """Add what every verb takes."""
    group = parser.add_argument_group('options of every verb')
    group.add_argument('--json', metavar='FILE', help='write the result as JSON; - is stdout')
    group.add_argument(
        '--require',
        metavar='RULE',
        type=rule,
        action='append',
        default=[],
        help="exit 1 unless the result's value keeps a limit: NAME<=VALUE or NAME>=VALUE, with "
        'dots between keys; holds for all items of a list, * is every key; may be repeated',
    )
    group.add_argument('--seed', type=seed, default=0, help='of all random numbers (%(default)s)')
    group.add_argument(
        '--jobs',
        type=count,
        default=n_cores(),
        help='processes at once, and simulations at once in a recording that is searched (%(default)s)',
    )


def add_machine(parser: argparse.ArgumentParser) -> None:
    """Add the choice of the machine description."""
    parser.add_argument(
        '--machine', metavar='YAML', default=DEFAULT_MACHINE, help='machine (%(default)s)'
    )


def machine_path(text: str) -> Path:
    """Return a machine's file: as given, or else where this package keeps its own."""
    path = Path(text)
    if path.is_file() or path.is_absolute():
        return path
    for folder in _config_homes():
        if (folder / path).is_file():
            return folder / path
    return path


def _config_homes() -> Iterable[Path]:
    """Yield the folders that hold ``config``: a checkout, a colcon workspace, an environment."""
    yield Path(__file__).resolve().parents[2]
    prefixes = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    for prefix in [*filter(None, prefixes), sys.prefix]:
        yield Path(prefix) / 'share' / 'escalator_twin'


def check_bags(paths: Iterable[str], machine_text: str) -> tuple[Path, Machine]:
    """Make sure that bags can be read and hold a topic of the machine, the bags first.

    Returns
    -------
    Path, Machine
        The machine's file and what it describes.

    Raises
    ------
    BagError, MachineError, RecordingError
        On the first thing that is wrong.
    """
    found = {path: bagfile.topics(path) for path in paths}
    file = machine_path(machine_text)
    machine = load_machine(file)
    instruments = machine.instruments
    for path, infos in found.items():
        there = {info.topic for info in infos if info.n_messages}
        measured = {instruments.measured_topic(s.topic) for s in instruments.sensors}
        simulated = {instruments.simulated_topic(s.topic) for s in instruments.sensors}
        if not there & (measured | simulated):
            raise RecordingError(
                f'{path}: none of the needed topics is there: '
                f'expected {_some(measured)}, found {_some(there) or "no message"}'
            )
    return file, machine


def _some(names: Iterable[str]) -> str:
    """Return some names in a row."""
    ordered = sorted(names)
    more = f' and {len(ordered) - 4} more' if len(ordered) > 4 else ''
    return ', '.join(ordered[:4]) + more


__all__ = [
    'EscalatorError',
    'add_common',
    'add_machine',
    'check_bags',
    'machine_path',
    'positive',
]
