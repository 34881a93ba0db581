"""``python -m belt OUT [CAUSE=SIZE...]``, from ``tests/``: one recording of the second machine.

As designed, its instruments' errors by ``instruments=N``; or with ``seed=N`` a machine drawn within
its tolerances, whose truth goes to ``OUT/../truth/NAME.json``. ``duration=S`` sets its length.
"""

from pathlib import Path
import sys

from belt.chain import CAUSES, read_sheet
from belt.good import hide
from belt.recording import FAULTS, make_recording

DEFAULT = Path(__file__).resolve().parents[2] / 'config' / 'machines' / 'kwon.yaml'
DURATION_S, START_M, SEED = 60.0, 9.0, 1


def main():
    """Write a recording; return 2 on a cause that there is not."""
    hidden, given = {}, {}
    for item in sys.argv[2:]:
        name, _, size = item.partition('=')
        if name in ('seed', 'duration', 'instruments'):
            given[name] = float(size)
            continue
        if name not in (*CAUSES, 'roller_drag_axle', *FAULTS):
            print(f'{name}: expected one of {", ".join((*CAUSES, *FAULTS))}', file=sys.stderr)
            return 2
        hidden[name] = float(size or 1.0)
    out, duration = Path(sys.argv[1]), given.get('duration', DURATION_S)
    if 'seed' in given:
        truth = out.parent / 'truth' / f'{out.name}.json'
        hide(out, truth, DEFAULT, int(given['seed']), hidden, duration)
    else:
        seed = int(given.get('instruments', SEED))
        make_recording(out, read_sheet(DEFAULT), START_M, duration, seed, hidden)
    return 0


if __name__ == '__main__':
    sys.exit(main())
