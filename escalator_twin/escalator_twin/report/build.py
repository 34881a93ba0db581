"""Build the page: read documents, ask every section, fill the templates."""

import base64
from collections.abc import Sequence
from datetime import datetime, UTC
from functools import cache
import hashlib
from importlib.resources import files
import json
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from escalator_twin import __version__
from escalator_twin.errors import EscalatorError
from escalator_twin.report.documents import Page, read_page
from escalator_twin.report.numerals import FILTERS
from escalator_twin.report.section import Context, Section
from escalator_twin.report.sections import SECTIONS

SCRIPTS = ('series.js', 'panel.js', 'page.js')  # one scope, in this order
STYLES = ('page.css', 'tables.css', 'plots.css')
Parts = list[tuple[Section, Context]]

STATIC = files('escalator_twin.report').joinpath('static')


def build(
    documents: Sequence[Any],
    out: str | Path,
    names: Sequence[str] = (),
    written: datetime | None = None,
) -> dict[str, Any]:
    """Write one self-contained HTML page.

    Parameters
    ----------
    documents : sequence
        Of `compare`, `check` and `diagnose`, in any mixture, as parsed from JSON.
    out : path
        File to write; nothing is left of it where that fails.
    names : sequence of str
        The documents' files, for messages and for the list of sources.
    written : datetime, optional
        Printed on the page; now by default.

    Returns
    -------
    dict
        ``n_bytes`` of the page and its ``sections``.

    Raises
    ------
    EscalatorError
        Where a document is of no known schema, or the page cannot be written.
    """
    page = read_page(documents, names)
    parts = filled(page)
    text = render(page, parts, written or datetime.now(UTC))
    data = text.encode('utf-8')
    part = Path(out).with_name(f'.{Path(out).name}.part')
    try:
        part.write_bytes(data)
        part.replace(out)
    except OSError as error:
        raise EscalatorError(f'{out}: cannot be written: {error.strerror or error}') from error
    finally:
        part.unlink(missing_ok=True)
    return {'n_bytes': len(data), 'sections': [section.name for section, _ in parts]}


def render(page: Page, parts: Parts, written: datetime) -> str:
    """Return the page as HTML."""
    script = Markup(f'(() => {{\n{_static(SCRIPTS)}}})();\n')
    return (
        environment()
        .get_template('page.html')
        .render(
            page=page,
            parts=parts,
            script=script,
            script_hash=_hash(script),
            style=Markup(_static(STYLES)),
            version=__version__,
            written=written,
        )
    )


def filled(page: Page) -> Parts:
    """Return the sections that have something to tell, with what they tell."""
    found = [(section, section.context(page)) for section in SECTIONS]
    return [(section, context) for section, context in found if context is not None]


@cache
def environment() -> Environment:
    """Return the templates' environment: everything is escaped, a missing name is an error."""
    made = Environment(
        loader=PackageLoader('escalator_twin.report'),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.filters.update(FILTERS)
    made.filters['embedded'] = embedded
    return made


def embedded(value: Any) -> Markup:
    """Return JSON for a script element: nothing in it can end the element or begin another."""
    shown = json.dumps(value, ensure_ascii=True, allow_nan=False, separators=(',', ':'))
    for character in '<>&':
        shown = shown.replace(character, f'\\u{ord(character):04x}')
    return Markup(shown)


def _static(names: Sequence[str]) -> str:
    return ''.join(STATIC.joinpath(name).read_text(encoding='utf-8') for name in names)


def _hash(script: str) -> str:
    """Return what the page's content security policy allows to run."""
    digest = hashlib.sha256(script.encode('utf-8')).digest()
    return 'sha256-' + base64.b64encode(digest).decode('ascii')
