"""Measure the twin's own error on recordings of good machines of free bodies.

    python -m escalator_twin.diagnosis.bodies.calibrate BAG... --designed BAG... --machine M

The recordings must be of good machines by another program; their truth is not read. From those of a
machine exactly as designed comes what means differ by: tolerances do nothing there.
"""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from escalator_twin import bagfile
from escalator_twin.diagnosis.bodies.context import (
    aligned,
    BodyContext,
    LEAN,
    PLACES,
    prepare,
    ZEROS,
)
from escalator_twin.diagnosis.bodies.search import propose
from escalator_twin.diagnosis.context import Beside
from escalator_twin.diagnosis.floor import Floor, kind_of, Level, mean_level, measure_level
from escalator_twin.diagnosis.floor_file import write_floor
from escalator_twin.diagnosis.proposals import false_fall
from escalator_twin.diagnosis.search_whole import LIKE_KNOBS
from escalator_twin.diagnosis.unexplained import by_channel
from escalator_twin.diagnosis.whitening import frequencies, sensor_variance
from escalator_twin.machine import load_machine, Machine
from escalator_twin.signals import Floats

PASSES = 3  # each weighs by the floor of the one before
# A longer chain moves the waves of the gears as treads and joints that yield otherwise do, and a
# stiffer carriage does nearly the same. How far the twin is off by that is measured with a wide prior.
LEANING = {'chain_elongation': 1e-3, 'tensioner_stiffness': 0.3}
WARMINGS = 6  # until the temperature reproduces itself


@dataclass(frozen=True)
class Seen:
    """One channel of one good machine.

    Attributes
    ----------
    level : Level
    above : float
        What its mean is above that of the machine as described, SI.
    within : float
        One standard deviation of that by the tolerances alone.
    """

    level: Level
    above: float
    within: float


def measure(context: BodyContext) -> dict[str, Seen]:
    """Return what every channel is beside the twin's in one recording."""
    place = aligned(context, context.machine, context.base)
    stage, observation = place.stage, place.stage.observation
    rate, n = observation.frame.rate_hz, len(observation.index)
    orders = frequencies(n, rate) * observation.frame.pitch_m / observation.frame.speed_m_s
    left = _left(place)
    count = np.maximum(observation.valid.sum(axis=0), 1)
    means = np.where(observation.valid, left, 0.0).sum(axis=0) / count
    knobs = np.isin(stage.nuisance.names, list(context.knobs))
    columns = np.where(observation.valid[:, :, None], stage.nuisance.columns, 0.0)[:, :, knobs]
    turns = columns.sum(axis=0) / count[:, None]
    above = means + turns @ place.fitted.sizes[knobs]
    within = np.sqrt(np.sum(turns**2, axis=1))
    waves = stage.whiten((left - means)[:, :, None])
    weight = np.where(stage.whiten.weight > 0.0, stage.whiten.weight, np.inf)
    coefficients = waves.reshape(len(weight), -1) / weight
    found = {}
    for k, channel in enumerate(observation.channels):
        sensor = context.machine.instruments.sensor(channel)
        own = sensor_variance(sensor, rate)
        white = coefficients[:, k].astype(np.float64) / own**0.5
        level = measure_level(white, orders, own, n)
        found[channel] = Seen(level, float(above[k]), float(within[k]))
    return found


def _left(place: Beside) -> Floats:
    """Return measured less simulated, all nuisance but the zeros taken out, means kept."""
    stage = place.stage
    names = stage.nuisance.names
    sizes = place.fitted.sizes * [not name.endswith('/zero') for name in names]
    difference = stage.observation.measured - place.model
    return np.asarray(difference - np.tensordot(stage.nuisance.columns, sizes, 1))


def floor_of(
    contexts: Sequence[BodyContext], machine: Machine, designed: Sequence[BodyContext] = ()
) -> Floor:
    """Measure the floor on several prepared recordings, means on those as designed if there are."""
    floor = Floor({}, leans=LEANING)
    for _ in range(PASSES):
        rows: dict[str, list[Seen]] = {}
        speeds = []
        for context in contexts:
            speeds.append(context.setting.experiment.set_speed_m_s)
            for channel, row in measure(replace(context, floor=floor)).items():
                rows.setdefault(channel, []).append(row)
        exact: dict[str, list[Seen]] = {}
        for context in designed:
            for channel, row in measure(replace(context, floor=floor)).items():
                exact.setdefault(channel, []).append(replace(row, within=0.0))
        speed = round(float(np.mean(speeds)), 3)
        levels = {}
        for channel, found in rows.items():
            sensor = machine.instruments.sensor(channel)
            level = mean_level([seen.level for seen in found])
            if sensor.quantity not in ZEROS:
                more = exact.get(channel, [])
                if not more or max(seen.within for seen in found) < sensor.noise * abs(
                    sensor.scale
                ):
                    more = [*found, *more]  # tolerances do nothing to it in any machine
                level = replace(level, mean=mean_of(more))
            levels[kind_of(sensor)] = {speed: level}
        # means only weigh once all is measured: they must not bend what tolerances explain
        bare = {
            kind: {s: replace(level, mean=None) for s, level in by_speed.items()}
            for kind, by_speed in levels.items()
        }
        floor = Floor(bare, leans=LEANING)
    floor = Floor(levels, leans=leans_of([replace(c, floor=floor) for c in contexts]))
    floor = replace(floor, temperature=temperature_of(contexts, machine, floor))
    places = [aligned(replace(c, floor=floor), machine, c.base) for c in contexts]
    logs = np.log([by_channel(place) for place in places])
    return replace(floor, clean=(float(logs.mean()), float(logs.std())))


def leans_of(contexts: Sequence[BodyContext]) -> dict[str, float]:
    """Return the root mean square of the sizes that good machines seem to have."""
    squares: dict[str, list[float]] = {cause: [] for cause in LEANING}
    for context in contexts:
        place = aligned(context, context.machine, context.base)
        for cause, wide in LEANING.items():
            name = LIKE_KNOBS[cause][0] if cause in LIKE_KNOBS else LEAN + cause
            k = place.stage.nuisance.names.index(name)
            squares[cause].append((wide * float(place.fitted.sizes[k])) ** 2)
    return {cause: float(np.mean(rows)) ** 0.5 for cause, rows in squares.items()}


def temperature_of(contexts: Sequence[BodyContext], machine: Machine, floor: Floor) -> float:
    """Return the factor by which false causes exceed what white noise would make of them.

    Priors take part in what a cause explains, so that it is sought until it reproduces itself.
    """
    heat = 1.0
    for _ in range(WARMINGS):
        at = replace(floor, temperature=heat)
        ratios = []
        for context in contexts:
            there = replace(context, floor=at)
            place = aligned(there, machine, there.base)
            ratios.append(false_fall(propose(there, place, 1), PLACES))
        heat = max(1.0, heat * float(np.mean(ratios)))
    return heat


def mean_of(rows: Sequence[Seen]) -> tuple[float, float]:
    """Return what a channel's mean is above the twin's, and a further machine's scatter about it.

    What tolerances do to it is none of that scatter: they are nuisance by themselves. But the mean of a
    few machines is as unsure as they let it be.
    """
    n, above = len(rows), np.array([row.above for row in rows])
    own = float(np.mean([row.within**2 for row in rows]))
    whole = float(np.var(above, ddof=1)) if n > 1 else float(above[0] ** 2)
    whole = max(whole, own)
    return float(above.mean()), float(np.sqrt(whole - own + whole / n))


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('bags', nargs='+', metavar='BAG')
    parser.add_argument('--designed', nargs='*', metavar='BAG', default=[])
    parser.add_argument('--machine', default='config/machines/kwon.yaml')
    parser.add_argument('--out', type=Path)
    parser.add_argument('--jobs', type=int, default=1)
    given = parser.parse_args()
    machine = load_machine(given.machine)
    assert machine.source is not None
    out = given.out or machine.source.with_name(f'{machine.name}_floor.yaml')
    contexts: list[BodyContext] = []
    for bag in [*given.bags, *given.designed]:
        recording = bagfile.read(bag, machine)
        known = contexts[0].loops if contexts else None
        contexts.append(prepare(recording, machine, Floor({}), given.jobs, known=known))
        print(bag, flush=True)
    names = ', '.join(Path(bag).name for bag in [*given.bags, *given.designed])
    n = len(given.bags)
    text = (
        f'What is left between the twin and generated good machines (synthetic: tests/belt;\n'
        f'# {names}), by escalator_twin.diagnosis.bodies.calibrate.'
    )
    write_floor(out, floor_of(contexts[:n], machine, contexts[n:]), text)


if __name__ == '__main__':
    main()
