"""``python -m benchmarks.spoiled BAG``: what is told of a recording once a rig did to it what rigs do.

Each way to spoil a recording is put into a copy of it, and each copy diagnosed by the command line, as a user
would. The recordings are given (the labelled ones are synthetic); what is spoiled is said, nothing is scored.
"""

import argparse
from collections.abc import Callable, Iterator
from dataclasses import replace
import json
from pathlib import Path
import subprocess
import sys
import time

import numpy as np

from benchmarks.measure import MACHINE
from escalator_twin import bagfile
from escalator_twin.machine import load_machine, Machine
from escalator_twin.signals import Floats, make_signal, Recording, Signal

WAY = Callable[[Recording, Machine], Recording]
REST_S = 6.0


def _of(recording: Recording, machine: Machine, quantity: str) -> list[Signal]:
    """Return the signals of one quantity."""
    of = {s.channel for s in machine.instruments.sensors if s.quantity == quantity}
    return [s for c, s in recording.signals.items() if c in of]


def _with(recording: Recording, *signals: Signal) -> Recording:
    return replace(recording, signals={**recording.signals, **{s.channel: s for s in signals}})


def _values(signal: Signal, parts: Floats) -> Signal:
    return make_signal(signal.channel, signal.unit, signal.stamp_ns, signal.bag_ns, parts)


def _held(signal: Signal, begin: float, end: float) -> Signal:
    """Return a signal that repeats its value from one share of its length to another."""
    n = len(signal.parts)
    a, b = round(begin * n), round(end * n)
    parts = np.array(signal.parts)
    parts[a:b] = parts[a]
    return _values(signal, parts)


def _lossy(signal: Signal, share: float) -> Signal:
    """Return a signal without some of its samples, at random."""
    return signal.only(np.random.default_rng(3).random(len(signal.parts)) >= share)


def _rested(signal: Signal, machine: Machine) -> Signal:
    """Return a signal with the machine at rest before and after."""
    sensor = machine.instruments.sensor(signal.channel)
    rng, noise = np.random.default_rng(6), sensor.noise * abs(sensor.scale)
    n, step = round(REST_S * sensor.rate_hz), round(1e9 / sensor.rate_hz)
    rest = [p + noise * rng.normal(size=(n, len(p))) for p in (signal.parts[0], signal.parts[-1])]
    before, after = -step * np.arange(n, 0, -1), step * np.arange(1, n + 1)
    stamp, bag = (
        np.concatenate([t[0] + before, t, t[-1] + after]) for t in (signal.stamp_ns, signal.bag_ns)
    )
    parts = np.concatenate([rest[0], signal.parts, rest[1]])
    return make_signal(signal.channel, signal.unit, stamp, bag, parts)


def _first(quantity: str, change: Callable[[Signal], Signal]) -> WAY:
    """Return the way that spoils the first channel of a quantity."""
    return lambda r, m: _with(r, change(_of(r, m, quantity)[0]))


def _every(quantity: str, change: Callable[[Signal], Signal]) -> WAY:
    """Return the way that spoils all channels of a quantity."""
    return lambda r, m: _with(r, *(change(s) for s in _of(r, m, quantity)))


def _without(quantity: str) -> WAY:
    def left(recording: Recording, machine: Machine) -> Recording:
        gone = {s.channel for s in _of(recording, machine, quantity)}
        kept = {c: s for c, s in recording.signals.items() if c not in gone}
        return replace(recording, signals=kept)

    return left


def _turned(recording: Recording, _: Machine) -> Recording:
    assert recording.experiment is not None
    way = -recording.experiment.direction
    return replace(recording, experiment=replace(recording.experiment, direction=way))


FORCE, STEP, WAYS_OF = 'link_force', 'step_acceleration', 'carriage_displacement'
WAYS: dict[str, WAY] = {
    'as it is': lambda r, _: r,
    'a link holds its value for 5 %': _first(FORCE, lambda s: _held(s, 0.45, 0.5)),
    'a link dies at 40 %': _first(FORCE, lambda s: _held(s, 0.4, 1.0)),
    'a link reads zero': _first(FORCE, lambda s: _values(s, 0.0 * s.parts)),
    'a link reads the wrong way': _first(FORCE, lambda s: _values(s, -s.parts)),
    'the tensioner reads the wrong way': _every(WAYS_OF, lambda s: _values(s, -s.parts)),
    '3 % of the accelerations are lost': _every(STEP, lambda s: _lossy(s, 0.03)),
    'no tensioner': _without(WAYS_OF),
    'no accelerations': _without(STEP),
    'no links': _without(FORCE),
    'accelerations alone': lambda r, m: _without(FORCE)(_without(WAYS_OF)(r, m), m),
    'six seconds at rest at both ends': lambda r, m: _with(
        r, *(_rested(s, m) for s in r.signals.values())
    ),
    'accelerations in g': _every(STEP, lambda s: _values(s, s.parts / 9.80665)),
    'the tensioner in mm': _every(WAYS_OF, lambda s: _values(s, 1e3 * s.parts)),
    'the wrong direction said': _turned,
}


def told(bag: Path, machine_file: str, jobs: int) -> tuple[str, float]:
    """Return what the command line tells of a bag, in a line, and its time, s."""
    out = bag.with_suffix('.json')
    command = [
        sys.executable,
        '-m',
        'escalator_twin.cli.main',
        'diagnose',
        str(bag),
        '--json',
        str(out),
    ]
    begun = time.monotonic()
    ran = subprocess.run(
        [*command, '--machine', machine_file, '--jobs', str(jobs)],
        capture_output=True,
        text=True,
        check=False,
    )
    seconds = time.monotonic() - begun
    if ran.returncode:
        return f'refused: {ran.stderr.strip().splitlines()[-1]}', seconds
    found = json.loads(out.read_text(encoding='utf-8'))
    names = [
        f'{e["cause"]} {", ".join(str(v) for v in e["location"].values())} ({e["probability"]:.2f})'
        for e in found['effects']
    ]
    rest = found['unexplained']
    left = f'; {100.0 * rest["share"]:.0f} % open' if rest['significant'] else ''
    return (' and '.join(names) or 'nothing') + left, seconds


def lines(bag: Path, machine_file: str, out: Path, jobs: int) -> Iterator[str]:
    """Yield the rows of a table, one for each way."""
    machine = load_machine(machine_file)
    recording = bagfile.read(bag, machine)
    yield '| spoiled | told | s |'
    yield '|---|---|---|'
    for k, (name, way) in enumerate(WAYS.items()):
        path = out / f'{k:02d}'
        bagfile.write(
            path, way(recording, machine), machine, machine.instruments.measured_namespace
        )
        text, seconds = told(path, machine_file, jobs)
        yield f'| {name} | {text} | {seconds:.0f} |'


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('bag', type=Path)
    parser.add_argument('--machine', default=str(MACHINE))
    parser.add_argument('--out', type=Path, required=True, help='where the copies go')
    parser.add_argument('--jobs', type=int, default=2)
    given = parser.parse_args()
    for line in lines(given.bag, given.machine, given.out, given.jobs):
        print(line, flush=True)


if __name__ == '__main__':
    main()
