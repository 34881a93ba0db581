"""How far the twin is off in what a rail's step does to a step's z: python -m benchmarks.shaken --out DIR.

Machines within tolerance of the independent generator, each recorded twice: as it is, and with a bump. The twin is
tuned to the first recording and run with the bump that was laid; the same noise is in both, so that what the bump does
is their difference.
"""

import argparse
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from rig.hidden import DURATION_S
from rig.machine import Case
from rig.make import Effect, make, Order, write
from scipy import ndimage

from escalator_twin import bagfile
from escalator_twin.comparison.locate import locate
from escalator_twin.diagnosis.floor_file import load_floor
from escalator_twin.diagnosis.observation import observe
from escalator_twin.diagnosis.preparation import prepare_tolerances
from escalator_twin.diagnosis.stage import Stage
from escalator_twin.diagnosis.tuning import tuned
from escalator_twin.machine import Deviation, load_machine, Machine
from escalator_twin.signals import Floats

NEXT_TO_NOTHING = 0.02  # of its length, by which rollers that rattle roll their dice anew
WINDOW = 11  # grid points over which power is averaged
# Seed, speed (m/s), load (kg a step), preload (N), height (mm), side.
CASES = (
    (7101, 0.5, 0.0, 3000.0, 1.5, 'right'), (7102, 0.5, 0.0, 3000.0, 1.5, 'left'),
    (7103, 0.5, 0.0, 6000.0, 1.5, 'both'), (7104, 0.5, 75.0, 3000.0, 1.5, 'right'),
    (7105, 0.25, 0.0, 3000.0, 1.5, 'left'), (7106, 0.25, 75.0, 6000.0, 1.5, 'both'),
    (7107, 0.5, 0.0, 6000.0, 0.5, 'right'), (7108, 0.5, 75.0, 6000.0, 0.5, 'left'),
    (7109, 0.5, 0.0, 3000.0, 1.2, 'both'), (7110, 0.25, 0.0, 6000.0, 1.5, 'right'),
    (7111, 0.5, 0.0, 3000.0, 0.5, 'both'), (7112, 0.5, 0.0, 6000.0, 2.1, 'left'),
)  # fmt: skip


@dataclass(frozen=True)
class Answers:
    """What one bump does to a step's z, along the grid, over the noise, (n,) each.

    Attributes
    ----------
    theirs, ours : float64
        The generator's and the twin's.
    rolled : float64
        The twin's with a bump that is longer or shorter by next to nothing, less ``ours``.
    """

    theirs: Floats
    ours: Floats
    rolled: Floats

    @property
    def scale(self) -> float:
        """How strong theirs is, of ours."""
        return float(self.theirs @ self.ours / (self.ours @ self.ours))

    def share(self, of: Floats) -> float:
        """Return power of our answer's."""
        return float(of @ of / (self.ours @ self.ours))


def recorded(row: tuple, out: Path) -> tuple[Path, Path, Deviation]:
    """Make both recordings of a case, where they are not there."""
    seed, speed, load, preload, height, side = row
    rng = np.random.default_rng(seed)
    place, length = float(rng.uniform(0.0, 24.4)), float(rng.uniform(0.04, 0.08))
    case = Case(speed, int(rng.choice((1, -1))), load, preload)
    location: dict[str, object] = {'s_m': place, 'side': side}
    size = {'height_m': 1e-3 * height, 'length_m': length}
    order = Order(seed, case, DURATION_S[speed], ())
    paths = []
    for name, effects in (('plain', ()), ('bump', (Effect('guide_step', location, size),))):
        paths.append(out / f'{seed}_{name}')
        if not paths[-1].exists():
            write(make(replace(order, effects=effects)), paths[-1], None)
    return paths[0], paths[1], Deviation('guide_step', dict(size), location)


def answers(row: tuple, out: Path, machine: Machine, jobs: int) -> Answers:
    """Return what a case's bump does, by the generator and by the twin."""
    plain, bump, deviation = recorded(row, out)
    context = prepare_tolerances(bagfile.read(plain, machine), machine, load_floor(machine), jobs)
    context, place = tuned(context, jobs=jobs)
    stage = place.stage
    # where each sample was is known from the recording without the bump: both ran alike
    other = locate(bagfile.read(bump, machine), machine)
    tracks = {
        c: replace(t, values=other.tracks[c].values) for c, t in stage.setting.tracks.items()
    }
    setting = replace(stage.setting, tracks=tracks)
    with_bump = observe(setting, place.judgement, machine, context.frame, context.start_m)
    at = stage.observation.channels.index('step/acceleration/z')

    def z_of(signals: Floats) -> Floats:
        found: Floats = stage.whiten.along(signals - signals.mean(axis=0))[:, at]
        return found

    ours = _run(stage, place.model, deviation, 1.0)
    near = _run(stage, place.model, deviation, 1.0 + NEXT_TO_NOTHING)
    return Answers(
        z_of(with_bump.measured - stage.observation.measured), z_of(ours), z_of(near - ours)
    )


def _run(stage: Stage, base: Floats, deviation: Deviation, share: float) -> Floats:
    length = share * deviation.parameters['length_m']
    longer = replace(deviation, parameters={**deviation.parameters, 'length_m': length})
    return stage.run((longer,)) - base


def lines(out: Path, machine: Machine, jobs: int, rows: tuple = CASES) -> Iterator[str]:
    """Yield a table's rows, one of each case."""
    yield '| machine | z of theirs, of ours | off, of ours | but for its strength | next to nothing | off by its own, a point |'
    yield '|---|---|---|---|---|---|'
    for row in rows:
        found = answers(row, out, machine, jobs)
        off, shape = found.theirs - found.ours, found.theirs - found.scale * found.ours
        power = ndimage.uniform_filter1d(found.ours**2, WINDOW)
        hot = power > 1.0
        per_point = float(np.mean(shape[hot] ** 2 / power[hot])) if hot.any() else 0.0
        yield (
            f'| {", ".join(map(str, row))} | {found.scale:.2f} | {found.share(off):.3f} | '
            f'{found.share(shape):.3f} | {found.share(found.rolled):.3f} | {per_point:.2f} |'
        )


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--out', type=Path, required=True, help='where recordings are made')
    parser.add_argument('--machine', default='config/machines/prototype.yaml')
    parser.add_argument('--jobs', type=int, default=2)
    parser.add_argument('--most', type=int, default=len(CASES), help='machines')
    given = parser.parse_args()
    machine = load_machine(given.machine)
    for line in lines(given.out, machine, given.jobs, CASES[: given.most]):
        print(line, flush=True)


if __name__ == '__main__':
    main()
