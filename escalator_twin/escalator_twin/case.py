"""What an operator set, told in keys: the ``--case`` of `simulate`, or a YAML file beside a recording."""

from collections.abc import Callable, Mapping
from dataclasses import replace
import math
import os
from pathlib import Path
from typing import Any

import yaml

from escalator_twin.errors import ExperimentError
from escalator_twin.machine import DIRECTIONS, Machine
from escalator_twin.signals import Experiment

BESIDE = 'experiment.yaml'


def parse_case(text: str | None, machine: Machine) -> Experiment:
    """Return the experiment that a case describes, the rest from the machine's default.

    Parameters
    ----------
    text : str or None
        ``speed=0.5,direction=up,load=75,preload=3000``, or the path of a YAML file with these
        keys, where ``load`` may be a list, one value a step. ``None``: the default.
    machine : Machine
        Gives the default and the number of steps.

    Raises
    ------
    ExperimentError
        Naming the key, what is expected and what was found.
    """
    default = machine.default_experiment()
    if not text:
        return default
    data, where = (_inline(text), '--case') if '=' in text else (_file(text), text)
    return _changed(default, data, where, machine)


def case_beside(
    path: str | os.PathLike[str], machine: Machine, said: Experiment | None
) -> Experiment | None:
    """Return what a file beside a recording says was set; what the recording itself says where there is none.

    Parameters
    ----------
    path : path
        A rosbag2 directory: ``experiment.yaml`` in it; or one file: ``<its name>.experiment.yaml``, or its
        rosbag2 directory's.
    machine : Machine
        Gives the number of steps.
    said : Experiment or None
        By the recording. The file's keys win; without it they all have to be there.

    Raises
    ------
    ExperimentError
        Naming the file and key, what is expected and what was found.
    """
    bag = Path(path)
    files = [bag / BESIDE] if bag.is_dir() else [bag.with_name(f'{bag.stem}.{BESIDE}')]
    if not bag.is_dir() and bag.with_name('metadata.yaml').is_file():
        files.append(bag.with_name(BESIDE))
    file = next((file for file in files if file.is_file()), None)
    if file is None:
        return said
    data = _file(str(file))
    missing = [key for key in KEYS if key not in data]
    if said is None and missing:
        raise ExperimentError(
            f'{file}: expected {", ".join(KEYS)}, as the recording has no experiment topic; '
            f'missing: {", ".join(missing)}'
        )
    return _changed(said or machine.default_experiment(), data, str(file), machine)


def _changed(
    experiment: Experiment, data: Mapping[str, Any], where: str, machine: Machine
) -> Experiment:
    """Return an experiment with some keys of a case laid over it."""
    changes: dict[str, Any] = {}
    for key, value in data.items():
        if key not in KEYS:
            raise ExperimentError(
                f'{where}: {key}: unknown key; expected one of {", ".join(KEYS)}'
            )
        name, read = KEYS[key]
        changes[name] = read(f'{where}: {key}', value)
    loads = changes.get('load_per_step_kg', ())
    n_steps = machine.chain.n_links
    if len(loads) not in (0, 1, n_steps):
        raise ExperimentError(
            f'{where}: load: expected one value or one for each of {n_steps} steps, '
            f'found {len(loads)}'
        )
    try:
        return replace(experiment, **changes)
    except ExperimentError as error:
        raise ExperimentError(f'{where}: {error}') from error


def _inline(text: str) -> dict[str, str]:
    data: dict[str, str] = {}
    for item in text.split(','):
        key, equals, value = (part.strip() for part in item.partition('='))
        if not equals or not key:
            raise ExperimentError(f'--case: expected key=value, found {item!r}')
        if key in data:
            raise ExperimentError(f'--case: {key}: given twice')
        data[key] = value
    return data


def _file(text: str) -> Mapping[str, Any]:
    path = Path(text)
    try:
        data = yaml.safe_load(path.read_text(encoding='utf-8'))
    except OSError as error:
        raise ExperimentError(f'{path}: cannot be read: {error.strerror or error}') from error
    except (UnicodeDecodeError, yaml.YAMLError, RecursionError) as error:
        raise ExperimentError(f'{path}: not YAML: {" ".join(str(error).split())}') from error
    if not isinstance(data, dict):
        raise ExperimentError(f'{path}: expected the keys {", ".join(KEYS)}, found {data!r}')
    return {str(key): value for key, value in data.items()}


def _number(where: str, value: Any) -> float:
    if isinstance(value, int | float | str) and not isinstance(value, bool):
        try:
            number = float(value)
        except (ValueError, OverflowError):
            number = math.nan
        if math.isfinite(number):
            return number
    raise ExperimentError(f'{where}: expected a number, found {value!r}')


def _loads(where: str, value: Any) -> tuple[float, ...]:
    if isinstance(value, list):
        return tuple(_number(f'{where}[{i}]', item) for i, item in enumerate(value))
    return (_number(where, value),)


def _direction(where: str, value: Any) -> int:
    if str(value).lower() not in DIRECTIONS:
        raise ExperimentError(f'{where}: expected {" or ".join(DIRECTIONS)}, found {value!r}')
    return DIRECTIONS[str(value).lower()]


# key of a case -> field of the experiment, and how it is read
KEYS: dict[str, tuple[str, Callable[[str, Any], Any]]] = {
    'speed': ('set_speed_m_s', _number),
    'direction': ('direction', _direction),
    'load': ('load_per_step_kg', _loads),
    'preload': ('preload_n', _number),
}
