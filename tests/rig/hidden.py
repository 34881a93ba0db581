"""Make a set of recordings in which something is hidden, the truth apart."""

from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
import json
from pathlib import Path
import shutil

import numpy as np

from rig.catalogue import draw_effect, KINDS, LISTED, NOT_LISTED, SHARES
from rig.machine import Case
from rig.make import Effect, make, Order, write

CLEAN_SHARE, UNLISTED_SHARE = 0.15, 0.15  # -, of the machines
SPEEDS_M_S, LOADS_KG, PRELOADS_N = (0.25, 0.5), (0.0, 75.0), (3000.0, 6000.0)
EXPERIMENTS = tuple(Case(*row) for row in product(SPEEDS_M_S, (1, -1), LOADS_KG, PRELOADS_N))
DURATION_S = {0.25: 165.0, 0.5: 110.0}  # s, more than a loop and a half, as the campaign's
SEED_STEP = 1000  # recordings of one set have seeds of their own


@dataclass(frozen=True)
class Plan:
    """One machine of the set: what is hidden, and its recordings' orders."""

    name: str
    cause: str | None
    size: str | None
    orders: tuple[Order, ...]


def draw_case(rng: np.random.Generator, needs_load: bool) -> Case:
    """Draw one of the 16 experiments, a loaded one where it is needed."""
    load = LOADS_KG[1] if needs_load else float(rng.choice(LOADS_KG))
    return Case(
        float(rng.choice(SPEEDS_M_S)),
        int(rng.choice((1, -1))),
        load,
        float(rng.choice(PRELOADS_N)),
    )


def draw_cause(rng: np.random.Generator) -> str | None:
    """Draw nothing, a cause of the list, or one that is on none."""
    kind = rng.uniform()
    if kind < CLEAN_SHARE:
        return None
    names = list(NOT_LISTED) if kind < CLEAN_SHARE + UNLISTED_SHARE else list(LISTED)
    return names[int(rng.integers(len(names)))]


def draw_causes(
    rng: np.random.Generator, index: int, causes: list[str] | None, effects: int
) -> list[str]:
    """Return what is hidden in one machine: ``causes`` in turn, or one or several drawn."""
    if effects > 1:
        names = causes or list(LISTED)
        chosen = rng.choice(len(names), effects, replace=False)
        return [names[int(k)] for k in chosen]
    cause = causes[index % len(causes)] if causes else draw_cause(rng)
    return [] if cause in (None, 'clean') else [str(cause)]


def plan(
    index: int,
    seed: int,
    recordings: int,
    causes: list[str] | None = None,
    sizes: tuple[str, ...] = tuple(SHARES),
    effects: int = 1,
) -> Plan:
    """Draw one machine of the set; ``causes`` are taken in turn instead of drawn.

    With several ``effects`` that many different causes are drawn from ``causes``, or from the list.
    As many ``recordings`` as there are experiments are those, one of each.
    """
    rng = np.random.default_rng([seed, index])
    hidden: list[Effect] = []
    drawn: list[str] = []
    names = draw_causes(rng, index, causes, effects)
    for name in names:
        size = sizes[int(rng.integers(len(sizes)))] if KINDS[name].has_size else None
        hidden.append(draw_effect(rng, name, SHARES[size] if size else 1.0))
        drawn += [size] if size else []
    needs_load = any(KINDS[name].needs_load for name in names)
    is_whole = recordings == len(EXPERIMENTS)
    first = seed * SEED_STEP + index * recordings
    orders = []
    for k in range(recordings):
        case = EXPERIMENTS[k] if is_whole else draw_case(rng, needs_load)
        orders.append(
            Order(first + k, case, DURATION_S[case.speed_m_s], tuple(hidden), machine_seed=first)
        )
    name = f'machine_{index:03d}'
    return Plan(name, '+'.join(names) or None, '+'.join(drawn) or None, tuple(orders))


def left_there(
    order: Order, size: str | None, bag: Path, truth_file: Path
) -> tuple[Effect, ...] | None:
    """Return what an earlier run hid in a recording that it finished; None where it made none.

    Raises
    ------
    ValueError
        The recording is another one: of another seed, or with something else in it, or of another size.
    """
    if not truth_file.exists():  # it is written last
        shutil.rmtree(bag, ignore_errors=True)
        return None
    truth = json.loads(truth_file.read_text())
    effects = tuple(Effect(**effect) for effect in truth['effects'])
    found = (truth['seed'], [effect.cause for effect in effects], truth['size'])
    expected = (order.seed, [effect.cause for effect in order.effects], size)
    if found != expected:
        raise ValueError(f'{bag}: expected seed, causes and size {expected}, found {found}')
    return effects


def write_plan(chosen: Plan, out: Path, keep: bool = False) -> dict:
    """Make one machine's recordings; return its line of the manifest, which tells nothing.

    What only a run can tell, as where a stop is in the motion, the first one tells for all: it is one machine.
    With ``keep``, recordings that an earlier run finished there are taken over.
    """
    paths: list[str] = []
    effects = chosen.orders[0].effects
    for k, order in enumerate(chosen.orders):
        name = f'{chosen.name}_{k}'
        bag, truth_file = out / name, out / 'truth' / f'{name}.json'
        paths.append(name)
        known = left_there(order, chosen.size, bag, truth_file) if keep else None
        if known is not None:
            effects = known
            continue
        made = make(replace(order, effects=effects))
        effects = tuple(Effect(**effect) for effect in made.truth['effects'])
        made.truth['size'] = chosen.size
        write(made, bag, truth_file)
    return {'name': chosen.name, 'recordings': paths}


def in_turn(plans: list[Plan], out: Path, jobs: int, keep: bool = False) -> Iterator[dict]:
    """Make the machines' recordings, ``jobs`` at a time; yield their lines in order."""
    one: partial[dict] = partial(write_plan, out=out, keep=keep)
    if jobs == 1:
        yield from map(one, plans)
        return
    with ProcessPoolExecutor(jobs) as pool:
        yield from pool.map(one, plans)


def write_hidden(
    plans: Iterable[Plan], seed: int, out: Path, jobs: int = 1, keep: bool = False
) -> None:
    """Make the planned machines' recordings in ``out``, with a manifest and the truth apart.

    With ``keep``, a set that was interrupted goes on.
    """
    chosen, machines = list(plans), []
    for line in in_turn(chosen, out, jobs, keep):
        machines.append(line)
        print(f'{len(machines)} of {len(chosen)}: {line["name"]}', flush=True)
    manifest = {'schema': 'rig/manifest/1', 'seed': seed, 'machines': machines}
    (out / 'manifest.json').write_text(json.dumps(manifest, indent=1) + '\n')
