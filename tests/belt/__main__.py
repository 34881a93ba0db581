"""``python -m belt OUT [CAUSE=SIZE...]``, from ``tests/``: one recording of the second machine."""

from pathlib import Path
import sys

from belt.chain import CAUSES, read_sheet
from belt.recording import FAULTS, make_recording

DEFAULT = Path(__file__).resolve().parents[2] / 'config' / 'machines' / 'kwon.yaml'
DURATION_S, START_M, SEED = 60.0, 9.0, 1


def main():
    """Write a recording; return 2 on a cause that there is not."""
    hidden = {}
    for item in sys.argv[2:]:
        name, _, size = item.partition('=')
        if name not in (*CAUSES, 'roller_drag_axle', *FAULTS):
            print(f'{name}: expected one of {", ".join((*CAUSES, *FAULTS))}', file=sys.stderr)
            return 2
        hidden[name] = float(size or 1.0)
    make_recording(sys.argv[1], read_sheet(DEFAULT), START_M, DURATION_S, SEED, hidden)
    return 0


if __name__ == '__main__':
    sys.exit(main())
