"""Diagnose recordings of a machine of free bodies and tell what was weighed on the way.

    python -m escalator_twin.diagnosis.bodies.attempt BAG... --machine M [--without CHANNEL...]

For measuring how far the method is; the verdict itself is that of the verb `diagnose`.
"""

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import replace

from escalator_twin import bagfile
from escalator_twin.diagnosis.diagnose import diagnose_recording, Diagnosis
from escalator_twin.errors import RecordingError
from escalator_twin.machine import load_machine
from escalator_twin.signals import Recording

MOST = 5  # candidates told


def lines_of(diagnosis: Diagnosis) -> Iterator[str]:
    """Tell what is named, what is weighed, what stays open, and what is left of every channel."""
    for effect in diagnosis.effects:
        numbers = {
            name: f'{p["value"]:.4g} ({p["low"]:.4g} to {p["high"]:.4g})'
            for name, p in effect['parameters'].items()
        }
        yield f'named: {effect["cause"]} {effect["location"]} {numbers}'
    if not diagnosis.effects:
        yield 'named: nothing'
    for row in diagnosis.candidates[:MOST]:
        yield f'weighed: {row["cause"]} {row["location"]} probability {row["probability"]:.3f}'
    for found, probability in diagnosis.found:
        proposal = found.proposal
        yield (
            f'walked: {proposal.cause} {dict(proposal.parameters)} chi squared falls by '
            f'{found.gain:.0f}, probability in the end {probability:.3f}'
        )
    rest = diagnosis.unexplained
    yield f'unexplained: {"significant" if rest.significant else "not significant"}'
    for channel, row in diagnosis.residual['before'].items():
        after = diagnosis.residual['after'][channel]['chi2']
        yield f'chi squared over the floor: {channel} {row["chi2"]:.2f}, in the end {after:.2f}'


def without(recording: Recording, channels: Sequence[str]) -> Recording:
    """Return a recording as if some channels had not been recorded.

    Raises
    ------
    RecordingError
        Where one of them was not.
    """
    for channel in channels:
        if channel not in recording.signals:
            found = ', '.join(recording.signals)
            raise RecordingError(f'{recording.path}: --without {channel}: expected one of {found}')
    left = {c: s for c, s in recording.signals.items() if c not in channels}
    return replace(recording, signals=left)


def main() -> None:
    """Attempt one recording after the other."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('bags', nargs='+', metavar='BAG')
    parser.add_argument('--machine', default='config/machines/kwon.yaml')
    parser.add_argument('--seed', type=int, default=0)
    parser.add_argument('--jobs', type=int, default=1)
    parser.add_argument(
        '--without',
        nargs='*',
        default=[],
        metavar='CHANNEL',
        help='as if it had not been recorded',
    )
    given = parser.parse_args()
    machine = load_machine(given.machine)
    for bag in given.bags:
        recording = without(bagfile.read(bag, machine), given.without)
        found = diagnose_recording(recording, machine, given.seed, given.jobs)
        print(bag)
        for line in lines_of(found):
            print(f'  {line}', flush=True)


if __name__ == '__main__':
    main()
