"""The floor's file: read, written, and that of another machine where there is none."""

from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from escalator_twin.diagnosis.floor import (
    Clean,
    Floor,
    kind_of,
    Level,
    ORDERS,
    SCHEMA,
    TEMPERATURE,
)
from escalator_twin.diagnosis.whitening import sensor_variance
from escalator_twin.errors import MachineError
from escalator_twin.machine import load_machine, Machine, machines_folder
from escalator_twin.machine.multibody import MultibodyMachine

LENDER = 'prototype'  # whose floor stands for that of a machine of linked chains


def load_floor(machine: Machine) -> Floor:
    """Read a machine's floor; where it has none, that of another machine stands for it.

    A machine of linked chains borrows that of the machine that its description extends under another name, or
    the prototype's, see `borrowed_by`.
    """
    floor = own_floor(machine)
    if floor.levels or isinstance(machine, MultibodyMachine):
        return floor
    for path in (*machine.bases, *_prototype()):
        lender = load_machine(path)
        lent = own_floor(lender)
        if lent.levels:
            return borrowed_by(machine, lender, lent)
    return floor


def _prototype() -> Iterator[Path]:
    with suppress(FileNotFoundError):  # the package alone was installed
        yield machines_folder() / f'{LENDER}.yaml'


def own_floor(machine: Machine) -> Floor:
    """Read the floor of this name, beside the description or what it extends; without, sensors' noise alone."""
    for path in (machine.source, *machine.bases):
        if path is not None:
            file = path.with_name(f'{machine.name}_floor.yaml')
            if file.exists():
                return read_floor(file)
    return Floor({})


def borrowed_by(machine: Machine, lender: Machine, floor: Floor) -> Floor:
    """Return another machine's floor in units of a machine's own noise.

    What the twin's laws leave is taken as it was measured, SI, and what channels' means are off by is not known.
    """
    own, other = (_variances(m) for m in (machine, lender))
    levels = {}
    for kind in own.keys() & floor.levels.keys():
        ratio = other[kind] / own[kind]
        levels[kind] = {
            speed: replace(
                level,
                smooth=np.where(
                    level.smooth > 1.0, 1.0 + ratio * (level.smooth - 1.0), level.smooth
                ),
                mean=None,
            )
            for speed, level in floor.levels[kind].items()
        }
    return replace(floor, levels=levels, borrowed=lender.name)


def _variances(machine: Machine) -> dict[str, float]:
    """Return the variance of noise at one rate, by kind of channel; without noise there is nothing to lend to."""
    found: dict[str, float] = {}
    for sensor in machine.instruments.sensors:
        variance = sensor_variance(sensor, 1.0)
        if variance > 0.0:
            found.setdefault(kind_of(sensor), variance)
    return found


def read_floor(path: Path) -> Floor:
    """Read a floor's file.

    Raises
    ------
    MachineError
        Where it is not what it should be.
    """
    data: Any = yaml.safe_load(path.read_text(encoding='utf-8'))
    if not isinstance(data, dict) or data.get('schema') != SCHEMA:
        raise MachineError(f'{path}: schema: expected {SCHEMA!r}')
    levels: dict[str, dict[float, Level]] = {}
    for row in data['levels']:
        level = Level(
            np.array(row['smooth'], float),
            np.array(row['lines'], float),
            _pair(row.get('mean')),
            np.array(row['spread'], float) if 'spread' in row else None,
        )
        if len(level.smooth) != len(ORDERS) - 1:
            raise MachineError(f'{path}: smooth: expected {len(ORDERS) - 1} numbers')
        levels.setdefault(row['kind'], {})[float(row['speed_m_s'])] = level
    leans = {cause: float(size) for cause, size in data.get('leans', {}).items()}
    heat = float(data.get('temperature', TEMPERATURE))
    groups = tuple(_clean(path, row) for row in data.get('clean_groups', []))
    return Floor(levels, _pair(data.get('clean')), heat, leans, groups)


def _clean(path: Path, row: Mapping[str, Any]) -> Clean:
    """Read what one maker's good recordings look like."""
    count = row.get('recordings')
    if not isinstance(count, int) or count < 2:
        raise MachineError(
            f'{path}: clean_groups: recordings: expected a number above 1, found {count!r}'
        )
    kinds = {kind: (float(a), float(b)) for kind, (a, b) in row['kinds'].items()}
    return Clean(str(row.get('source', '')), count, kinds)


def _pair(found: list[float] | None) -> tuple[float, float] | None:
    """Return a mean and a standard deviation, where a file gives them."""
    return None if found is None else (float(found[0]), float(found[1]))


def write_floor(path: Path, floor: Floor, source: str) -> None:
    """Write a floor's file; ``source`` says what it was measured on."""
    rows = [
        {
            'kind': kind,
            'speed_m_s': speed,
            'smooth': [float(f'{v:.3g}') for v in level.smooth],
            'lines': [float(f'{v:.3g}') for v in level.lines],
            **(
                {'spread': [float(f'{v:.3g}') for v in level.spread]}
                if level.spread is not None
                else {}
            ),
            **({'mean': [float(f'{v:.3g}') for v in level.mean]} if level.mean else {}),
        }
        for kind, levels in floor.levels.items()
        for speed, level in levels.items()
    ]
    clean = {'clean': [float(f'{v:.3g}') for v in floor.clean]} if floor.clean else {}
    heat = {'temperature': float(f'{floor.temperature:.3g}')}
    leans = {cause: float(f'{size:.3g}') for cause, size in floor.leans.items()}
    told: dict[str, Any] = {'leans': leans} if leans else {}
    if floor.groups:
        told['clean_groups'] = [
            {
                'source': group.source,
                'recordings': group.recordings,
                'kinds': {
                    kind: [float(f'{v:.3g}') for v in pair] for kind, pair in group.kinds.items()
                },
            }
            for group in floor.groups
        ]
    whole = {'schema': SCHEMA, **heat, **clean, **told, 'levels': rows}
    text = yaml.safe_dump(whole, sort_keys=False, width=100)
    path.write_text(f'# {source}\n{text}', encoding='utf-8')
