"""The JSON of the verbs as a page reads it: checked at the door, then taken as it is.

A page is made from files that may be old, foreign or written by hand. What a section cannot do
without is checked here and named in the error; all else may be missing, and is then left out.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
import math
from pathlib import PurePath
from typing import Any

from escalator_twin.errors import EscalatorError

Json = Mapping[str, Any]

CHECK, COMPARE, DIAGNOSIS = (
    'escalator_twin/check/1',
    'escalator_twin/compare/1',
    'escalator_twin/diagnosis/1',
)
SCHEMAS = (CHECK, COMPARE, DIAGNOSIS)


@dataclass(frozen=True)
class Entry:
    """One recording, check or diagnosis of the page.

    Attributes
    ----------
    key : str
        Unique on the page; used in anchors.
    label : str
        What people call it.
    source : str
        The file that it came in.
    machine : str
        Description that was used; empty where the document does not say.
    data : mapping
        Its part of the document, without NaN.
    """

    key: str
    label: str
    source: str
    machine: str
    data: Json


@dataclass(frozen=True)
class Page:
    """All that a page is made from.

    Attributes
    ----------
    recordings : tuple of Entry
        Comparisons, those that a diagnosis repeats told once.
    checks, diagnoses : tuple of Entry
    sources : tuple of (file, schema)
    """

    recordings: tuple[Entry, ...]
    checks: tuple[Entry, ...]
    diagnoses: tuple[Entry, ...]
    sources: tuple[tuple[str, str], ...]


def read_page(documents: Sequence[Any], names: Sequence[str] = ()) -> Page:
    """Check documents and sort their parts.

    Parameters
    ----------
    documents : sequence
        As parsed from JSON.
    names : sequence of str
        Their files, for messages; counted where not given.

    Raises
    ------
    EscalatorError
        Names the file, what was expected and what was found.
    """
    if not documents:
        raise EscalatorError('report: expected one or more documents, found none')
    recordings: list[Entry] = []
    checks: list[Entry] = []
    diagnoses: list[Entry] = []
    sources = []
    for i, document in enumerate(documents):
        name = names[i] if i < len(names) else f'document {i + 1}'
        data = finite(_checked(document, name))
        machine = text(data.get('machine'))
        sources.append((name, data['schema']))
        if data['schema'] == CHECK:
            checks.append(_entry('check', len(checks), data, name, machine))
            continue
        if data['schema'] == DIAGNOSIS:
            diagnoses.append(_entry('diagnosis', len(diagnoses), data, name, machine))
        for part in data['recordings']:
            if not any(_is_same(part, machine, other) for other in recordings):
                recordings.append(_entry('recording', len(recordings), part, name, machine))
    return Page(_labelled(recordings), _labelled(checks), tuple(diagnoses), tuple(sources))


def _checked(document: Any, name: str) -> Json:
    """Return a document of a known schema whose recordings have channels."""
    schema = document.get('schema') if isinstance(document, Mapping) else None
    if schema not in SCHEMAS:
        raise EscalatorError(
            f'{name}: schema: expected one of {", ".join(SCHEMAS)}, found {schema!r}'
        )
    if schema == CHECK:
        return document
    _need(document, 'recordings', list, name)
    for i, part in enumerate(document['recordings']):
        where = f'{name}: recordings[{i}]'
        if not isinstance(part, Mapping):
            raise EscalatorError(f'{where}: expected an object, found {_kind(part)}')
        _need(part, 'channels', Mapping, where)
        for channel, scores in part['channels'].items():
            if not isinstance(scores, Mapping):
                raise EscalatorError(
                    f'{where}.channels.{channel}: expected an object, found {_kind(scores)}'
                )
    return document


def _need(data: Json, key: str, kind: type, where: str) -> None:
    expected = 'a list' if kind is list else 'an object'
    if key not in data:
        raise EscalatorError(f'{where}: {key}: expected {expected}, found nothing')
    if not isinstance(data[key], kind):
        raise EscalatorError(f'{where}: {key}: expected {expected}, found {_kind(data[key])}')


def _kind(value: Any) -> str:
    return 'null' if value is None else type(value).__name__


def _entry(kind: str, index: int, data: Json, source: str, machine: str) -> Entry:
    path = text(data.get('path'))
    label = text(data.get('case_id')) or PurePath(path).name or f'{kind} {index + 1}'
    return Entry(f'{kind}-{index + 1}', label, source, machine, data)


def _is_same(part: Json, machine: str, other: Entry) -> bool:
    """Tell whether a diagnosis repeats a comparison that the page has already."""
    return (
        machine in ('', other.machine)
        and part.get('path') == other.data.get('path')
        and part.get('channels') == other.data.get('channels')
    )


def _labelled(entries: list[Entry]) -> tuple[Entry, ...]:
    """Return entries whose labels differ: the bag's name, then a number, tells equals apart."""
    for attempt in (_with_path, _with_number):
        labels = [entry.label for entry in entries]
        entries = [
            attempt(entry, labels[:i]) if labels.count(entry.label) > 1 else entry
            for i, entry in enumerate(entries)
        ]
    return tuple(entries)


def _with_path(entry: Entry, _: list[str]) -> Entry:
    name = PurePath(text(entry.data.get('path'))).name
    label = f'{entry.label} · {name}' if name and name != entry.label else entry.label
    return Entry(entry.key, label, entry.source, entry.machine, entry.data)


def _with_number(entry: Entry, earlier: list[str]) -> Entry:
    label = f'{entry.label} #{earlier.count(entry.label) + 1}'
    return Entry(entry.key, label, entry.source, entry.machine, entry.data)


def finite(value: Any) -> Any:
    """Return ``value`` with null in the place of NaN and infinities, which JSON does not have."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    if isinstance(value, Mapping):
        return {str(key): finite(item) for key, item in value.items()}
    return value


def number(value: Any) -> float | None:
    """Return a number, ``None`` where there is something else."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    return float(value) if math.isfinite(value) else None


def text(value: Any) -> str:
    """Return text, empty where there is something else."""
    return value if isinstance(value, str) else ''


def table(value: Any) -> Json:
    """Return an object, empty where there is something else."""
    return value if isinstance(value, Mapping) else {}


def rows(value: Any) -> list[Json]:
    """Return the objects of a list, none where there is something else."""
    return [row for row in value if isinstance(row, Mapping)] if isinstance(value, list) else []


def numbers(value: Any) -> list[float | None]:
    """Return the numbers of a list, ``None`` in the place of anything else."""
    return [number(item) for item in value] if isinstance(value, list) else []


def unplaced(entry: Entry) -> list[str]:
    """Return the cases, or else paths, of a diagnosis's recordings whose place in the loop is not certain."""
    return [
        text(row.get('case_id')) or text(row.get('path'))
        for row in rows(entry.data.get('recordings'))
        if row.get('place_is_certain') is False
    ]


def is_judged(entry: Entry) -> bool:
    """Tell whether a diagnosis put any of its recordings beside the machine."""
    missing = unplaced(entry)
    return not missing or len(missing) < len(rows(entry.data.get('recordings')))
