"""Read a machine description: files, what they extend, and the class of their kind."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import yaml

from escalator_twin.errors import MachineError
from escalator_twin.machine.checks import check_linked
from escalator_twin.machine.linked import Machine
from escalator_twin.machine.multibody import check_multibody, MultibodyMachine
from escalator_twin.schema import build

SAFE = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)  # the compiled one is six times faster
SCHEMA = 'escalator_twin/machine/1'
# kind of physics -> its class, and what it must fulfil beyond the types of its keys
PHYSICS: dict[str, tuple[type[Machine], Callable[[Any], None]]] = {
    'linked_chain': (Machine, check_linked),
    'planar_multibody': (MultibodyMachine, check_multibody),
}


def load_machine(path: str | Path) -> Machine:
    """Read a machine description.

    A file may hold ``extends: other.yaml`` (beside it): then it gives only what differs;
    mappings are merged key by key, lists replaced.

    Raises
    ------
    MachineError
        Where the file cannot be read or a key is unknown, missing or of the wrong type.
    """
    path = Path(path)
    bases: list[Path] = []
    data = _read(path, bases)
    found = data.get('schema')
    if found != SCHEMA:
        raise MachineError(f'{path}: schema: expected {SCHEMA!r}, found {found!r}')
    physics = data.get('physics')
    if physics not in PHYSICS:
        raise MachineError(
            f'{path}: physics: expected one of {", ".join(PHYSICS)}, found {physics!r}'
        )
    tolerances: dict[str, float] = {}
    kind, check = PHYSICS[physics]
    machine = build(kind, data, str(path), tolerances)
    prefix = len(str(path)) + 1
    machine = replace(
        machine,
        source=path,
        bases=tuple(bases),
        tolerances={key[prefix:]: s for key, s in tolerances.items()},
    )
    check(machine)
    return machine


def machines_folder() -> Path:
    """Return the folder of the machine descriptions that come with the package."""
    for folder in Path(__file__).resolve().parents:
        if (folder / 'config' / 'machines').is_dir():
            return folder / 'config' / 'machines'
    raise FileNotFoundError('config/machines is neither beside nor above the package')


def _read(path: Path, bases: list[Path]) -> dict[str, object]:
    """Read one YAML file and what it extends, the nearer file winning; add what it extends to ``bases``."""
    try:
        data = yaml.load(path.read_text(encoding='utf-8'), Loader=SAFE)
    except (OSError, UnicodeDecodeError) as error:
        raise MachineError(f'{path}: cannot be read: {error}') from error
    except yaml.YAMLError as error:
        raise MachineError(f'{path}: not YAML: {" ".join(str(error).split())}') from error
    if not isinstance(data, dict):
        raise MachineError(f'{path}: expected a mapping, found {type(data).__name__}')
    for key in sorted({'bases', 'source', 'tolerances'} & set(data)):
        raise MachineError(f'{path}.{key}: unknown key')
    if 'extends' not in data:
        return data
    base = path.parent / str(data.pop('extends'))
    if base in bases:
        raise MachineError(f'{path}: extends: circle through {base}')
    bases.append(base)
    merged = _read(base, bases)
    # a survey named by the base lies beside the base
    guide = merged.get('guide')
    if isinstance(guide, dict) and guide.get('survey_file'):
        guide['survey_file'] = str((base.parent / str(guide['survey_file'])).resolve())
    return _merge(merged, data)


def _merge(base: dict[str, Any], change: dict[str, Any]) -> dict[str, Any]:
    """Return ``base`` with ``change`` laid over it."""
    merged = dict(base)
    for key, value in change.items():
        if isinstance(value, dict) and isinstance(merged.get(key), dict):
            merged[key] = _merge(merged[key], value)
        else:
            merged[key] = value
    return merged
