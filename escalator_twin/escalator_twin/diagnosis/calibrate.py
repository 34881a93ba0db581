"""Measure the twin's own error on recordings of machines within tolerance.

    python -m escalator_twin.diagnosis.calibrate BAG... --machine M --out FLOOR.yaml

The recordings must be of good machines by another program (``make hidden`` with ``clean``): their
truth is not read.
"""

import argparse
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from scipy.stats import chi2

from escalator_twin import bagfile
from escalator_twin.diagnosis.context import Context, prepare, prepare_tolerances, tuned
from escalator_twin.diagnosis.floor import (
    Floor,
    kind_of,
    Level,
    load_floor,
    mean_level,
    measure_level,
    write_floor,
)
from escalator_twin.diagnosis.responses import ALL_PLACES
from escalator_twin.diagnosis.unexplained import by_channel
from escalator_twin.diagnosis.walk import propose
from escalator_twin.diagnosis.whitening import frequencies, sensor_variance
from escalator_twin.machine import load_machine, Machine

SPEEDS_M_S = (0.25, 0.5)  # of the levels: those of the experiment plan


def measure(context: Context) -> tuple[float, dict[str, Level]]:
    """Return the speed and the levels by channel of one recording."""
    context, place = tuned(context)
    stage, observation = place.stage, place.stage.observation
    left = stage.residual(place.model)
    left = left - np.tensordot(stage.nuisance.columns, place.fitted.sizes, 1)
    left = left - left.mean(axis=0)
    rate, n = observation.frame.rate_hz, len(observation.index)
    orders = frequencies(n, rate) * observation.frame.pitch_m / observation.frame.speed_m_s
    whiten = stage.whiten
    waves = whiten(left[:, :, None]).reshape(len(whiten.weight), -1) / np.where(
        whiten.weight > 0.0, whiten.weight, 1.0
    )
    levels = {}
    for k, channel in enumerate(observation.channels):
        sensor = context.machine.instruments.sensor(channel)
        own = sensor_variance(sensor, rate)
        white = waves[:, k].astype(np.float64) / own**0.5
        levels[channel] = measure_level(white, orders, own, n)
    return observation.frame.speed_m_s, levels


def levels_of(path: str, machine: Machine) -> tuple[float, dict[str, Level]]:
    """Return the speed and the levels by channel of a recording, by the floor as it is."""
    recording = bagfile.read(path, machine)
    return measure(prepare_tolerances(recording, machine, load_floor(machine)))


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


def beside_floor(path: str, machine: Machine, floor: Floor) -> Good:
    """Look at a recording of a good machine as diagnosis would, beside a floor."""
    context = prepare(bagfile.read(path, machine), machine, floor)
    place = context.place
    assert place is not None
    false = [p for p in propose(context, place, 1) if p.cause in ALL_PLACES]
    columns = sum({p.cause: p.places for p in false}.values())
    white = float(chi2.ppf(0.5 ** (1.0 / max(columns, 1)), 1))
    fall = max((p.gain for p in false), default=0.0) / white
    channels = place.stage.observation.channels
    found = dict(zip(channels, map(float, by_channel(place)), strict=True))
    print(path, f'fall {fall:.2f}', {c: round(v, 3) for c, v in found.items()}, flush=True)
    return Good(fall, found)


def calibrate(paths: Sequence[str], machine: Machine, jobs: int = 1) -> Floor:
    """Measure the floor on several recordings."""
    sensors = {s.channel: s for s in machine.instruments.sensors}
    with ProcessPoolExecutor(jobs, get_context('spawn')) as pool:
        rows: dict[str, dict[float, list[Level]]] = {}
        for path, (speed, levels) in zip(
            paths, pool.map(partial(levels_of, machine=machine), paths), strict=True
        ):
            nearest = min(SPEEDS_M_S, key=lambda s: abs(np.log(s / speed)))
            for channel, level in levels.items():
                rows.setdefault(kind_of(sensors[channel]), {}).setdefault(nearest, []).append(
                    level
                )
            told = {c: round(float(np.mean(v.smooth)), 2) for c, v in levels.items()}
            print(path, told, flush=True)
        cold = Floor(
            {
                kind: {speed: mean_level(levels) for speed, levels in sorted(by_speed.items())}
                for kind, by_speed in rows.items()
            },
            temperature=1.0,
        )
        good = list(pool.map(partial(beside_floor, machine=machine, floor=cold), paths))
    kinds: dict[str, list[float]] = {}
    for one in good:
        for channel, value in one.chi2.items():
            kinds.setdefault(kind_of(sensors[channel]), []).append(float(np.log(value)))
    heat = max(1.0, float(np.mean([one.fall for one in good])))
    pairs = {kind: (float(np.mean(v)), float(np.std(v))) for kind, v in kinds.items()}
    return replace(cold, temperature=heat, clean_kinds=pairs)


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('bags', nargs='+', metavar='BAG')
    parser.add_argument('--machine', default='config/machines/prototype.yaml')
    parser.add_argument('--out', type=Path)
    parser.add_argument('--jobs', type=int, default=1)
    given = parser.parse_args()
    machine = load_machine(given.machine)
    assert machine.source is not None
    out = given.out or machine.source.with_name(f'{machine.name}_floor.yaml')
    floor = calibrate(given.bags, machine, given.jobs)
    text = (
        f'What is left between the twin and {len(given.bags)} generated good machines (synthetic).'
    )
    write_floor(out, floor, text)


if __name__ == '__main__':
    main()
