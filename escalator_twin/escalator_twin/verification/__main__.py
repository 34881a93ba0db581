"""``python -m escalator_twin.verification [PART...]``: the figures of docs/verification.md."""

from importlib import import_module
import sys

from escalator_twin.machine import load_machine
from escalator_twin.verification.trial import machines_folder

PARTS = ('polygon_limit', 'curves', 'wheel', 'statics', 'conservation')
MACHINES = {'wheel': 'prototype_wheel.yaml'}


def main() -> int:
    """Print every figure beside its bar; return 1 where one does not hold."""
    names = sys.argv[1:] or PARTS
    unknown = [name for name in names if name not in PARTS]
    if unknown:
        print(f'{unknown[0]}: expected one of {", ".join(PARTS)}', file=sys.stderr)
        return 2
    status = 0
    for name in names:
        machine = load_machine(machines_folder() / MACHINES.get(name, 'prototype.yaml'))
        found = import_module(f'escalator_twin.verification.{name}').figures(machine)
        print(f'\n{found[0].subject}')
        for figure in found:
            print(figure.line(), flush=True)
            status |= not figure.holds
    return int(status)


if __name__ == '__main__':
    sys.exit(main())
