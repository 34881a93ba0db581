"""Command line of the rig: ``python -m rig make|hidden|verify|...``."""

import argparse
from pathlib import Path

from rig.catalogue import KINDS, SHARES
from rig.floor import show_floor
from rig.hidden import plan, write_hidden
from rig.machine import Case
from rig.make import Effect, make, Order, write
from rig.readings import show_creep, show_rails, show_treads
from rig.readings_sensors import show_sensors
from rig.readings_speed import show_wander
from rig.samples import write_samples
from rig.verify import beside, verify


def read_case(text: str) -> Case:
    """Read ``speed=0.5,direction=up,load=75,preload=3000``."""
    given = dict(item.split('=', 1) for item in text.split(','))
    direction = {'up': 1, 'down': -1}[given['direction']]
    return Case(float(given['speed']), direction, float(given['load']), float(given['preload']))


def read_value(text: str) -> object:
    """Read a number, a list joined by commas, or a word."""
    if ',' in text:
        return [read_value(part) for part in text.split(',') if part]
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def read_effect(cause: str | None, settings: list[str]) -> tuple[Effect, ...]:
    """Sort ``--set`` entries into the effect's place and size."""
    if cause is None:
        return ()
    given = {key: read_value(text) for key, text in (item.split('=', 1) for item in settings)}
    location = {k: v for k, v in given.items() if k in PLACES}
    parameters = {k: v for k, v in given.items() if k not in PLACES}
    return (Effect(cause, location, parameters),)


PLACES = (
    'link',
    'links',
    'axle',
    'step',
    'steps',
    'side',
    's_m',
    's_from_m',
    's_to_m',
    'which',
    'gauge',
    'axis',
    'channel',
    'channels',
)


def parser() -> argparse.ArgumentParser:
    """Return the command line's parser."""
    root = argparse.ArgumentParser(prog='rig', description=__doc__)
    verbs = root.add_subparsers(dest='verb', required=True)
    one = verbs.add_parser('make', help='make one recording')
    one.add_argument('--seed', type=int, required=True)
    one.add_argument('--case', type=read_case, required=True)
    one.add_argument('--cause')
    one.add_argument('--set', action='append', default=[], metavar='KEY=VALUE')
    one.add_argument('--out', type=Path, required=True)
    one.add_argument('--truth', type=Path)
    one.add_argument('--duration', type=float, default=110.0)
    one.add_argument('--start-s', type=float)
    one.add_argument('--machine-seed', type=int)
    one.add_argument('--nominal', action='store_true', help='no tolerances drawn')
    samples = verbs.add_parser('samples', help="make the repository's sample recordings")
    samples.add_argument('--out', type=Path, required=True)
    many = verbs.add_parser('hidden', help='make recordings in which something is hidden')
    many.add_argument('--n', type=int, required=True, help='machines')
    many.add_argument('--seed', type=int, required=True)
    many.add_argument('--out', type=Path, required=True)
    many.add_argument(
        '--recordings', type=int, default=1, help='of each machine; 16: one of each experiment'
    )
    many.add_argument('--effects', type=int, default=1, help='hidden in each machine')
    many.add_argument(
        '--causes',
        nargs='*',
        choices=[*KINDS, 'clean'],
        metavar='NAME',
        help='take these in turn; clean for none',
    )
    many.add_argument('--sizes', nargs='+', choices=list(SHARES), default=list(SHARES))
    many.add_argument('--jobs', type=int, default=1, help='recordings made at a time')
    many.add_argument('--keep', action='store_true', help='take over what is made already')
    checked = verbs.add_parser('verify', help='show the rig beside the seeded recordings')
    checked.add_argument('--shared', type=Path, required=True)
    checked.add_argument('--tolerances', action='store_true', help='fit these too, slower')
    checked.add_argument('--only', nargs='*', default=[], metavar='NAME')
    read = verbs.add_parser(
        'readings', help='how the recordings decide what the sheet leaves open'
    )
    read.add_argument('--shared', type=Path, required=True)
    other = verbs.add_parser('beside', help='show the nominal rig beside other recordings')
    other.add_argument('bags', type=Path, nargs='+', metavar='BAG')
    left = verbs.add_parser('floor', help="what is left between the rig and the twin's own bags")
    left.add_argument('bags', type=Path, nargs='+', metavar='BAG')
    left.add_argument('--out', type=Path, metavar='JSON')
    left.add_argument('--rails', type=int, default=0, metavar='N', help='drawn rails beside it')
    return root


def main() -> None:
    """Run the verb."""
    given = parser().parse_args()
    if given.verb == 'make':
        order = Order(
            given.seed,
            given.case,
            given.duration,
            read_effect(given.cause, given.set),
            given.nominal,
            given.machine_seed,
            given.start_s,
        )
        write(make(order), given.out, given.truth)
    elif given.verb == 'samples':
        write_samples(given.out)
    elif given.verb == 'hidden':
        plans = [
            plan(
                index,
                given.seed,
                given.recordings,
                given.causes,
                tuple(given.sizes),
                given.effects,
            )
            for index in range(given.n)
        ]
        write_hidden(plans, given.seed, given.out, given.jobs, given.keep)
    elif given.verb == 'readings':
        seeded = given.shared / 'measured' / 'seeded'
        show_rails(seeded)
        show_treads(seeded)
        show_creep(seeded)
        show_sensors(seeded)
        show_wander(
            sorted(p.parent for p in (given.shared / 'measured').glob('*/*/metadata.yaml'))
        )
    elif given.verb == 'beside':
        beside(given.bags)
    elif given.verb == 'floor':
        show_floor(given.bags, given.out, given.rails)
    elif given.verb == 'verify':
        verify(given.shared, given.only, given.tolerances)


if __name__ == '__main__':
    main()
