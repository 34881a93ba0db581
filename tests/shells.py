"""What tests of the command line share: a recording, and a verb run in this process."""

from pathlib import Path

from makers import PROTOTYPE, prototype, synthetic

from escalator_twin import bagfile
from escalator_twin.cli.main import main

MACHINE = prototype()
GIVEN = ['--machine', str(PROTOTYPE)]


def bag_in(folder: Path) -> str:
    """Return the path of ten seconds of a recording, written into a folder."""
    bagfile.write(folder / 'bag', synthetic(MACHINE, 10.0), MACHINE, namespace='/measured')
    return str(folder / 'bag')


def run(capsys, *words):
    """Return status, output and errors of a command line."""
    status = main(list(words))
    out = capsys.readouterr()
    return status, out.out, out.err


def one_line(text):
    return text.count('\n') == 1 and text.endswith('\n')
