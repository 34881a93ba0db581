"""Measure the twin's own error on recordings of machines within tolerance.

    python -m escalator_twin.diagnosis.calibrate BAG... --machine M --out FLOOR.yaml
    python -m escalator_twin.diagnosis.calibrate --beside SEVERAL.json --machine M

The recordings must be of good machines by another program (``make hidden`` with ``clean``): their
truth is not read.
"""

import argparse
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
import json
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from scipy import fft

from escalator_twin import bagfile
from escalator_twin.diagnosis.context import Context, shares_of
from escalator_twin.diagnosis.floor import (
    cell_of,
    CELLS,
    Clean,
    Floor,
    is_shaken,
    kind_of,
    Level,
    mean_level,
    measure_level,
)
from escalator_twin.diagnosis.floor_file import own_floor, write_floor
from escalator_twin.diagnosis.grids import Frame
from escalator_twin.diagnosis.linked import propose
from escalator_twin.diagnosis.preparation import prepare, prepare_tolerances
from escalator_twin.diagnosis.proposals import false_fall
from escalator_twin.diagnosis.responses import ALL_PLACES
from escalator_twin.diagnosis.tuning import tuned
from escalator_twin.diagnosis.unexplained import by_channel
from escalator_twin.diagnosis.whitening import frequencies, sensor_variance
from escalator_twin.errors import MachineError
from escalator_twin.machine import load_machine, Machine, Sensor
from escalator_twin.signals import Floats

SPEEDS_M_S = (0.25, 0.5)  # of the levels: those of the experiment plan
LEAST_MACHINES = 3  # fewer have no scatter to speak of


@dataclass(frozen=True)
class Remainder:
    """What is left of a good machine's recording when all nuisance is taken out.

    Attributes
    ----------
    frame : Frame
    channels : tuple of str
    left : (n, c) float64
        SI; means removed.
    shares : (n, c) float64
        Where in the loop the step of each channel is, 0 to 1.
    """

    frame: Frame
    channels: tuple[str, ...]
    left: Floats
    shares: Floats

    @property
    def level_speed(self) -> float:
        """Speed of the level that it belongs to, m/s."""
        return min(SPEEDS_M_S, key=lambda s: abs(np.log(s / self.frame.speed_m_s)))


def measure(context: Context) -> Remainder:
    """Return what is left of one recording."""
    context, place = tuned(context)
    stage, observation = place.stage, place.stage.observation
    left = stage.residual(place.model)
    left = left - np.tensordot(stage.nuisance.columns, place.fitted.sizes, 1)
    left = np.where(observation.valid, left - left.mean(axis=0), 0.0)
    return Remainder(
        observation.frame, observation.channels, left, shares_of(context, observation)
    )


def spread_of(rows: Sequence[tuple[Remainder, int]], sensor: Sensor) -> Floats:
    """Return the standard deviation by place in the loop, mean square one, (CELLS,)."""
    total, count = np.zeros(CELLS), np.zeros(CELLS)
    for remainder, k in rows:
        cells = cell_of(remainder.shares[:, k])
        np.add.at(total, cells, remainder.left[:, k] ** 2)
        np.add.at(count, cells, 1.0)
    power = total / np.maximum(count, 1.0)
    # a cell that none of them passed is as uncertain as the worst
    power = np.where(count > 0.0, power, power.max())
    power = np.maximum(power, sensor.noise**2 * sensor.scale**2 / len(sensor.fields) * 1e-3)
    return np.asarray(np.sqrt(power / power.mean()))


def level_of(rows: Sequence[tuple[Remainder, int]], sensor: Sensor) -> Level:
    """Measure the floor of one kind of channel at one speed."""
    spread = spread_of(rows, sensor) if is_shaken(sensor) else None
    levels = []
    for remainder, k in rows:
        rate, n = remainder.frame.rate_hz, len(remainder.left)
        orders = frequencies(n, rate) * remainder.frame.pitch_m / remainder.frame.speed_m_s
        left = remainder.left[:, k]
        if spread is not None:
            left = left / spread[cell_of(remainder.shares[:, k])]
        own = sensor_variance(sensor, rate)
        waves = fft.dct(left, norm='ortho')[: len(orders)]
        levels.append(measure_level(waves / own**0.5, orders, own, n))
    return replace(mean_level(levels), spread=spread)


def remainder_of(path: str, machine: Machine) -> Remainder:
    """Return what is left of a recording, fitted beside the floor as it is."""
    recording = bagfile.read(path, machine)
    return measure(prepare_tolerances(recording, machine, own_floor(machine)))


@dataclass(frozen=True)
class Good:
    """What a good machine looks like beside the floor.

    Attributes
    ----------
    fall : float
        Largest fall of chi squared by a part that no good machine has, over that of white noise.
    chi2 : mapping of channel to float
        Chi squared per coefficient.
    """

    fall: float
    chi2: dict[str, float]


def beside_floor(path: str, floor: Floor, machine: Machine) -> Good:
    """Look at a recording of a good machine as diagnosis would, beside a floor."""
    context = prepare(bagfile.read(path, machine), machine, floor)
    place = context.place
    assert place is not None
    fall = false_fall(propose(context, place, 1), ALL_PLACES)
    channels = place.stage.observation.channels
    found = dict(zip(channels, map(float, by_channel(place)), strict=True))
    print(path, f'fall {fall:.2f}', {c: round(v, 3) for c, v in found.items()}, flush=True)
    return Good(fall, found)


def floor_of(remainders: Sequence[Remainder], machine: Machine) -> Floor:
    """Return the floor of what is left of several recordings, at temperature 1."""
    first: dict[str, Sensor] = {}
    for sensor in machine.instruments.sensors:
        first.setdefault(kind_of(sensor), sensor)
    sensors = {s.channel: s for s in machine.instruments.sensors}
    rows: dict[str, dict[float, list[tuple[Remainder, int]]]] = {}
    for remainder in remainders:
        for k, channel in enumerate(remainder.channels):
            by_speed = rows.setdefault(kind_of(sensors[channel]), {})
            by_speed.setdefault(remainder.level_speed, []).append((remainder, k))
    levels = {
        kind: {speed: level_of(found, first[kind]) for speed, found in by_speed.items()}
        for kind, by_speed in rows.items()
    }
    return Floor(levels, temperature=1.0)


def calibrate(paths: Sequence[str], machine: Machine, jobs: int = 1) -> Floor:
    """Measure the floor on several recordings, one of each machine.

    What a good machine looks like beside it is taken of each beside the floor of all others, as a
    recording that is diagnosed was not among those that the floor was measured on.
    """
    if len(paths) < LEAST_MACHINES:
        raise MachineError(
            f'expected recordings of {LEAST_MACHINES} good machines, found {len(paths)}'
        )
    sensors = {s.channel: s for s in machine.instruments.sensors}
    with ProcessPoolExecutor(jobs, get_context('spawn')) as pool:
        remainders = list(pool.map(partial(remainder_of, machine=machine), paths))
        others = [
            floor_of([*remainders[:k], *remainders[k + 1 :]], machine) for k in range(len(paths))
        ]
        good = list(pool.map(partial(beside_floor, machine=machine), paths, others))
    kinds: dict[str, list[float]] = {}
    for one in good:
        for channel, value in one.chi2.items():
            kinds.setdefault(kind_of(sensors[channel]), []).append(float(np.log(value)))
    heat = max(1.0, float(np.mean([one.fall for one in good])))
    own = Clean(f'{len(paths)} generated good machines', len(paths), scatter_of(kinds))
    return replace(floor_of(remainders, machine), temperature=heat, groups=(own,))


def scatter_of(logs: Mapping[str, Sequence[float]]) -> dict[str, tuple[float, float]]:
    """Return mean and standard deviation of each kind's logarithms of chi squared."""
    return {kind: (float(np.mean(v)), float(np.std(v, ddof=1))) for kind, v in logs.items()}


def of_campaign(path: Path, machine: Machine) -> Clean:
    """Return what one machine's recordings look like beside its named effects.

    Of another maker, whose machine is not known to be good: what no effect accounts for may be in
    it, so that the scatter is rather too wide than too narrow. A recording in which its own verdict
    says that something is left is no example of a good one.

    Parameters
    ----------
    path : Path
        Of the JSON that ``diagnose`` writes of several recordings.
    machine : Machine

    Raises
    ------
    MachineError
        Where fewer than three recordings hold no more than is named.
    """
    sensors = {s.channel: s for s in machine.instruments.sensors}
    rows = json.loads(path.read_text(encoding='utf-8'))['by_recording']
    rows = [row for row in rows if not row['unexplained']['significant']]
    if len(rows) < LEAST_MACHINES:
        raise MachineError(
            f'{path}: by_recording: expected {LEAST_MACHINES} recordings with nothing unexplained, '
            f'found {len(rows)}'
        )
    logs: dict[str, list[float]] = {}
    for row in rows:
        for channel, found in row['residual']['after'].items():
            logs.setdefault(kind_of(sensors[channel]), []).append(float(np.log(found['chi2'])))
    source = f'{len(rows)} recordings of one machine of another maker, beside its named effects'
    return Clean(source, len(rows), scatter_of(logs))


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('bags', nargs='*', metavar='BAG', help='none: the floor as it is')
    parser.add_argument(
        '--beside', type=Path, metavar='JSON', help="another maker's recordings, as diagnosed"
    )
    parser.add_argument('--machine', default='config/machines/prototype.yaml')
    parser.add_argument('--out', type=Path)
    parser.add_argument('--jobs', type=int, default=1)
    given = parser.parse_args()
    if not given.bags and given.beside is None:
        parser.error('expected recordings or --beside, found neither')
    machine = load_machine(given.machine)
    assert machine.source is not None
    out = given.out or machine.source.with_name(f'{machine.name}_floor.yaml')
    if given.bags:
        floor = calibrate(given.bags, machine, given.jobs)
    else:
        floor = own_floor(machine)
        if not floor.groups:
            parser.error(f'{machine.source}: its floor tells of no good machines: give recordings')
        floor = replace(floor, groups=floor.groups[:1])
    if given.beside:
        floor = replace(floor, groups=(*floor.groups, of_campaign(given.beside, machine)))
    text = f'What is left between the twin and {floor.groups[0].source} (synthetic).'
    write_floor(out, floor, text)


if __name__ == '__main__':
    main()
