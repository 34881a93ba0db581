"""Measure the twin's own error on recordings of machines within tolerance.

    python -m escalator_twin.diagnosis.calibrate BAG... --machine M --out FLOOR.yaml

The recordings must be of good machines by another program (``make hidden`` with ``clean``): their
truth is not read.
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from escalator_twin import bagfile
from escalator_twin.diagnosis.context import Context, prepare_tolerances, tuned
from escalator_twin.diagnosis.floor import (
    Floor,
    kind_of,
    Level,
    load_floor,
    mean_level,
    measure_level,
    write_floor,
)
from escalator_twin.diagnosis.whitening import frequencies, sensor_variance
from escalator_twin.machine import load_machine, Machine

SPEEDS_M_S = (0.25, 0.5)  # of the levels: those of the experiment plan


def measure(context: Context) -> tuple[float, dict[str, Level]]:
    """Return the speed and the levels by channel of one recording."""
    context, place = tuned(context, jobs=2)
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


def calibrate(paths: Sequence[str], machine: Machine) -> Floor:
    """Measure the floor on several recordings."""
    floor = load_floor(machine)
    rows: dict[str, dict[float, list[Level]]] = {}
    for path in paths:
        recording = bagfile.read(path, machine)
        context = prepare_tolerances(recording, machine, floor, jobs=2)
        speed, levels = measure(context)
        nearest = min(SPEEDS_M_S, key=lambda s: abs(np.log(s / speed)))
        for channel, level in levels.items():
            kind = kind_of(machine.instruments.sensor(channel))
            rows.setdefault(kind, {}).setdefault(nearest, []).append(level)
        print(path, {c: round(float(np.mean(v.smooth)), 2) for c, v in levels.items()}, flush=True)
    return Floor(
        {
            kind: {speed: mean_level(levels) for speed, levels in sorted(by_speed.items())}
            for kind, by_speed in rows.items()
        }
    )


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('bags', nargs='+', metavar='BAG')
    parser.add_argument('--machine', default='config/machines/prototype.yaml')
    parser.add_argument('--out', type=Path)
    given = parser.parse_args()
    machine = load_machine(given.machine)
    assert machine.source is not None
    out = given.out or machine.source.with_name(f'{machine.name}_floor.yaml')
    floor = calibrate(given.bags, machine)
    text = (
        f'What is left between the twin and {len(given.bags)} generated good machines (synthetic).'
    )
    write_floor(out, floor, text)


if __name__ == '__main__':
    main()
