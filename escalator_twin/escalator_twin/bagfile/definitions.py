"""Message definitions: from the bag, or where it has none, those known here."""

from functools import lru_cache
import os
from pathlib import Path
from typing import Any

from rosbags.typesys import (
    get_types_from_idl,
    get_types_from_msg,
    get_typestore,
    Stores,
    TypesysError,
)
from rosbags.typesys.store import Typestore

from escalator_twin.bagfile.own_types import DEFINITIONS

# type -> (constants, fields); a field is (name, (kind, detail)) in the way of rosbags
Types = dict[str, Any]
TEXT_KINDS = ('ros2msg',)
IDL_KINDS = ('ros2idl', 'omgidl')
# what the parsers raise on text that is no definition
FAILURES = (TypesysError, RecursionError, ValueError, KeyError, IndexError, TypeError)


def normalise_type(name: str) -> str:
    """Return ``pkg/msg/Type`` for the spellings ``pkg/Type`` and ``pkg::msg::Type``."""
    name = name.replace('::msg::dds_::', '/msg/').replace('::', '/')
    parts = name.split('/')
    return f'{parts[0]}/msg/{parts[1]}' if len(parts) == 2 else name


@lru_cache(maxsize=1)
def known_types() -> Types:
    """Return Jazzy's common types and this project's own."""
    types = dict(get_typestore(Stores.ROS2_JAZZY).fielddefs)
    for name, text in DEFINITIONS.items():
        types.update(get_types_from_msg(text, name))
    return types


@lru_cache(maxsize=256)
def types_of(name: str, encoding: str, text: str) -> Types:
    """Return the types that a schema defines, those it leaves out filled in from the known.

    Parameters
    ----------
    name : str
        The message's type.
    encoding, text : str
        As the bag has them; both may be empty or unusable.
    """
    own: Types = {}
    if text.strip() or encoding in TEXT_KINDS:  # of an empty message the text is empty too
        try:
            if encoding in IDL_KINDS or text.lstrip('=\n').startswith('IDL:'):
                own = dict(get_types_from_idl(text))
            elif encoding in TEXT_KINDS:
                own = dict(get_types_from_msg(text, name))
        except FAILURES:
            own = {}
    known = known_types()
    if name in known and (not text.strip() or not _is_whole(name, {**known, **own})):
        return known
    return {**known, **own} if name in own else known


def _is_whole(name: str, types: Types, above: tuple[str, ...] = ()) -> bool:
    """Tell whether a type and all that it is made of are defined, none containing itself."""
    if name not in types or name in above:
        return False
    return all(_is_whole(part, types, (*above, name)) for part in _named(types[name][1]))


def source_text(name: str) -> str | None:
    """Return the text of ``name`` from the packages that are installed, else from here."""
    package, _, kind = name.split('/')
    for prefix in os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep):
        path = Path(prefix) / 'share' / package / 'msg' / f'{kind}.msg'
        if prefix and path.is_file():
            return path.read_text(encoding='utf-8')
    return DEFINITIONS.get(name)


def typestore_for(names: set[str]) -> Typestore:
    """Return a store of Jazzy's types and those of ``names`` that are installed or known here.

    Raises
    ------
    TypesysError
        Where a definition is not one.
    """
    store = get_typestore(Stores.ROS2_JAZZY)
    pending = sorted(names)
    found: Types = {}
    while pending:
        name = pending.pop()
        if name in store.fielddefs or name in found or (text := source_text(name)) is None:
            continue
        types = get_types_from_msg(text, name)
        found.update(types)
        pending += [part for entry in types.values() for part in _named(entry[1])]
    if found:
        store.register(found)
    return store


def _named(fields: Any) -> list[str]:
    """Return the message types among a type's fields."""
    names = []
    for _, (kind, detail) in fields:
        while kind.name in ('ARRAY', 'SEQUENCE'):
            kind, detail = detail[0]
        if kind.name == 'NAME':
            names.append(detail)
    return names
