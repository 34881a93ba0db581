"""Make one recording and its truth from a seed."""

from dataclasses import asdict, dataclass, field, replace
import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from rig.bagfile import Recording, write_bag
from rig.causes import MACHINE_CAUSES
from rig.draw import (
    as_truth,
    build,
    draw_speed,
    draw_tolerances,
    draw_wander,
    lay_rails,
    Tolerances,
    Wander,
    WANDER_STEP_S,
)
from rig.faults import FAULTS, place_in_chain
from rig.instruments import draw_instruments, Instruments
from rig.machine import Case
from rig.model import Model, RECORD
from rig.places import loop_m
from rig.recording import record, sample, Signals
from rig.run import ROW_S, run
from rig.sheet import chosen, Sheet
from rig.unlisted import UNLISTED
from rig.unlisted_faults import UNLISTED_FAULTS

ALTERATIONS = {**MACHINE_CAUSES, **UNLISTED}
ALL_FAULTS = {**FAULTS, **UNLISTED_FAULTS}
SETTLE_S = 12.0  # s, until the start-up's transient is below the instruments' noise
RELATIVE = {'share_of_motion', 'share_of_peak'}
PILOT_S = 4.0  # s, two pitches at the lower speed
STREAMS = ('machine', 'rail', 'run', 'instruments', 'effects', 'noise')


@dataclass(frozen=True)
class Effect:
    """One deliberate deviation: its name, place and size."""

    cause: str
    location: dict[str, Any] = field(default_factory=dict)
    parameters: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Order:
    """What is asked for; everything that it leaves open is drawn from the seed."""

    seed: int
    case: Case
    duration_s: float = 110.0
    effects: tuple[Effect, ...] = ()
    is_nominal: bool = False  # no draw of tolerances, the likeliest rails
    machine_seed: int | None = None  # several recordings of one machine share it
    start_s_m: float | None = None
    wander: Wander | None = None  # as other makers' unless given


def streams(order: Order) -> dict[str, np.random.Generator]:
    """Return independent random generators by name, so that one draw does not shift another."""
    machine = order.seed if order.machine_seed is None else order.machine_seed
    result = {}
    for k, name in enumerate(STREAMS):
        seed = machine if name in ('machine', 'rail', 'effects') else order.seed
        result[name] = np.random.default_rng([k, seed])
    return result


@dataclass(frozen=True)
class Made:
    """A recording, the truth behind it and the signals it came from."""

    recording: Recording
    truth: dict[str, Any]
    rows: NDArray[np.float64]


def apply_effects(model: Model, order: Order, rng: np.random.Generator) -> Model:
    """Put the machine's effects into the model, in the order given."""
    for effect in order.effects:
        alter = ALTERATIONS.get(effect.cause)
        if alter is not None:
            model = alter(model, effect.location, effect.parameters, rng)
        elif effect.cause not in ALL_FAULTS:
            known = sorted([*ALTERATIONS, *ALL_FAULTS])
            raise ValueError(f'unknown cause {effect.cause!r}; known: {", ".join(known)}')
    return model


# More threads add up in another order: the last digits would hang on how many the machine has.
@threadpool_limits.wrap(limits=1, user_api='blas')
def make(order: Order) -> Made:
    """Run the machine and record it."""
    rng = streams(order)
    sheet = chosen()
    drawn = Tolerances() if order.is_nominal else draw_tolerances(rng['machine'])
    speed = draw_speed(rng['run'], order.case.speed_m_s)
    start = rng['run'].uniform(0.0, loop_m())
    start = start if order.start_s_m is None else order.start_s_m
    model = build(sheet, order.case, speed, drawn)._replace(
        wander=draw_wander(rng['run'], order.duration_s, order.wander), wander_step=WANDER_STEP_S
    )
    model = lay_rails(model, None if order.is_nominal else rng['rail'])
    order = resolve(order, model, start)
    model = apply_effects(model, order, rng['effects'])
    rows = run(model, start, SETTLE_S, order.duration_s)
    kit = draw_instruments(rng['instruments'])
    signals, kit = apply_faults(rows, kit, order, sheet, rng)
    recording = record(signals, kit, rng['noise'], header(order))
    return Made(recording, truth_of(order, drawn, model, kit, rows, signals), rows)


def resolve(order: Order, model: Model, start: float) -> Order:
    """Turn sizes that only a run can tell into lengths and forces, by a run without them.

    ``share_of_motion`` of a stop is 0 at the carriage's mean position and 1 at its
    outermost; ``share_of_peak`` of a slipping dog is the part of its largest pull that holds.
    """
    if not any(RELATIVE & set(effect.parameters) for effect in order.effects):
        return order
    rows = run(model, start, SETTLE_S, PILOT_S)
    u = rows[:, RECORD.index('u')]
    middle = 0.5 * (u.max() + u.min())
    peak = rows[:, RECORD.index('dog')].max()
    effects = []
    for effect in order.effects:
        size = dict(effect.parameters)
        if 'share_of_motion' in size:
            met = middle + size.pop('share_of_motion') * (u.max() - middle)
            size['displacement_m'] = float(met)
        if 'share_of_peak' in size:
            size['force_N'] = float(size.pop('share_of_peak') * peak)
        effects.append(replace(effect, parameters=size))
    return replace(order, effects=tuple(effects))


def apply_faults(
    rows: NDArray[np.float64],
    kit: Instruments,
    order: Order,
    sheet: Sheet,
    rng: dict[str, np.random.Generator],
) -> tuple[Signals, Instruments]:
    """Sample the machine with instruments that have the ordered faults."""
    faults = [e for e in order.effects if e.cause in ALL_FAULTS]
    for effect in faults:
        kit = ALL_FAULTS[effect.cause].kit(kit, effect.location, effect.parameters)
    signals = sample(rows, kit, sheet, rng['noise'])
    for effect in sorted(faults, key=lambda e: place_in_chain(e.cause)):
        signals = ALL_FAULTS[effect.cause].signals(
            signals, effect.location, effect.parameters, rng['effects']
        )
    return signals, kit


def header(order: Order) -> Recording:
    """Return the recording without its messages."""
    case = order.case
    words = (
        'high' if case.speed_m_s > 0.375 else 'low',
        'up' if case.direction > 0 else 'down',
        'full' if case.load_kg > 0.0 else 'empty',
        'hi' if case.preload_n > 4500 else 'lo',
    )
    return Recording(
        0, '_'.join(words), case.speed_m_s, case.direction, case.load_kg, case.preload_n, ()
    )


def truth_of(
    order: Order,
    drawn: Tolerances,
    model: Model,
    kit: Instruments,
    rows: NDArray[np.float64],
    signals: Signals,
) -> dict[str, Any]:
    """Return what only scoring may read."""
    column = {name: k for k, name in enumerate(RECORD)}
    first = round(signals.onboard_s[0] / ROW_S)
    ends = rows[first, [column['s_left'], column['s_right']]]
    loop = model.cell * model.lateral.size
    behind = (ends[1] - ends[0] + 0.5 * loop) % loop - 0.5 * loop
    duration = (rows.shape[0] - 1) * ROW_S
    travel = rows[-1, column['rack']] - rows[0, column['rack']]
    return {
        'schema': 'rig/truth/1',
        'seed': order.seed,
        'machine_seed': order.machine_seed,
        'case': asdict(order.case),
        'effects': [asdict(e) for e in order.effects],
        'speed_m_s': float(abs(travel) / duration),
        'loop_m': float(loop),
        'start_s_m': float((ends[0] + 0.5 * behind) % loop),
        'clock': {'offset_s': kit.clock_offset_s, 'drift_ppm': 1e6 * kit.clock_drift},
        'wander': model.wander[::50].round(7).tolist(),
        'tolerances': as_truth(drawn),
        'instruments': {k: np.asarray(v).tolist() for k, v in asdict(kit).items()},
    }


def write(made: Made, directory: Path, truth_file: Path | None) -> None:
    """Write the bag, and the truth elsewhere."""
    write_bag(made.recording, directory)
    if truth_file is not None:
        truth_file.parent.mkdir(parents=True, exist_ok=True)
        truth_file.write_text(json.dumps(made.truth, indent=1) + '\n')
