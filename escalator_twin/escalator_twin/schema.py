"""Turn a mapping read from YAML into frozen dataclasses; every error gives the key's path."""

from collections.abc import Mapping
import dataclasses
import types
import typing
from typing import Any, TypeVar

from escalator_twin.errors import MachineError

T = TypeVar('T')


def build(cls: type[T], data: object, where: str, tolerances: dict[str, float]) -> T:
    """Build the dataclass ``cls`` from ``data``.

    Parameters
    ----------
    cls : dataclass type
        Its field names are the keys; fields with a default may be left out, those that are
        not of its constructor may not be given.
    data : mapping
        As read from YAML. A number may be ``{value, tol}``.
    where : str
        Path of ``data`` in its file, for messages.
    tolerances : dict
        Receives ``path -> relative standard deviation`` of every ``{value, tol}``.

    Raises
    ------
    MachineError
        On an unknown or missing key, or a value of the wrong type.
    """
    if not isinstance(data, Mapping):
        raise MachineError(f'{where}: expected a mapping, found {data!r}')
    hints = typing.get_type_hints(cls)
    fields = {f.name: f for f in dataclasses.fields(cls) if f.init}  # type: ignore[arg-type]
    unknown = sorted(set(map(str, data)) - set(fields))
    if unknown:
        raise MachineError(
            f'{where}.{unknown[0]}: unknown key; expected one of {", ".join(fields)}'
        )
    values = {}
    for name, spec in fields.items():
        path = f'{where}.{name}'
        if name in data:
            values[name] = _convert(hints[name], data[name], path, tolerances)
        elif spec.default is dataclasses.MISSING and spec.default_factory is dataclasses.MISSING:
            raise MachineError(f'{path}: missing')
    return cls(**values)


def _convert(kind: Any, value: object, path: str, tolerances: dict[str, float]) -> Any:
    """Convert one YAML value to the annotated type ``kind``."""
    origin = typing.get_origin(kind)
    arguments = typing.get_args(kind)
    if origin in (typing.Union, types.UnionType):
        if value is None and type(None) in arguments:
            return None
        kind = next(a for a in arguments if a is not type(None))
        return _convert(kind, value, path, tolerances)
    if dataclasses.is_dataclass(kind):
        return build(typing.cast(type, kind), value, path, tolerances)
    if kind is float:
        return _number(value, path, tolerances)
    if origin is tuple:
        if not isinstance(value, list):
            raise MachineError(f'{path}: expected a list, found {value!r}')
        return tuple(
            _convert(arguments[0], item, f'{path}[{i}]', tolerances)
            for i, item in enumerate(value)
        )
    if origin is dict:
        if not isinstance(value, Mapping):
            raise MachineError(f'{path}: expected a mapping, found {value!r}')
        return {
            str(k): _convert(arguments[1], v, f'{path}.{k}', tolerances) for k, v in value.items()
        }
    if kind is int and (not isinstance(value, int) or isinstance(value, bool)):
        raise MachineError(f'{path}: expected a whole number, found {value!r}')
    if kind is str and not isinstance(value, str):
        raise MachineError(f'{path}: expected text, found {value!r}')
    return value


def _number(value: object, path: str, tolerances: dict[str, float]) -> float:
    """Read a number, or ``{value, tol}`` whose tolerance is kept by path."""
    if isinstance(value, Mapping):
        if set(value) != {'value', 'tol'}:
            raise MachineError(f'{path}: expected a number or {{value, tol}}, found {value!r}')
        tolerances[path] = _number(value['tol'], f'{path}.tol', tolerances)
        return _number(value['value'], f'{path}.value', tolerances)
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise MachineError(f'{path}: expected a number, found {value!r}')
    try:  # YAML 1.1 reads 1e-3 as text
        return float(value)
    except ValueError:
        raise MachineError(f'{path}: expected a number, found {value!r}') from None
