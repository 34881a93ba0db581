"""Make one self-contained HTML page from the JSON of the other verbs."""

import argparse
import json
from pathlib import Path
from typing import Any

from escalator_twin.cli.output import Document
from escalator_twin.errors import EscalatorError

SCHEMAS = ('escalator_twin/check/', 'escalator_twin/compare/', 'escalator_twin/diagnosis/')
MAX_BYTES = 1 << 30


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the verb's own arguments."""
    parser.add_argument('documents', metavar='JSON', nargs='+', help='written with --json')
    parser.add_argument('--out', metavar='FILE.html', required=True, help='page to write')


def run(args: argparse.Namespace) -> Document:
    """Build the page."""
    documents = [_read(Path(name)) for name in args.documents]
    folder = Path(args.out).absolute().parent
    if not folder.is_dir():
        raise EscalatorError(f'--out {args.out}: the directory {folder} is not there')
    from escalator_twin import report

    made = report.build(documents, args.out, names=args.documents)
    return {'schema': 'escalator_twin/report/1', 'out': args.out, **made}


def show(document: Document) -> str:
    """Return where the page is, and its size."""
    return f'{document["out"]}: {document["n_bytes"] / 1e6:.2f} MB\n'


def _read(path: Path) -> dict[str, Any]:
    try:
        if path.stat().st_size > MAX_BYTES:
            raise EscalatorError(f'{path}: larger than {MAX_BYTES} bytes')
        data = json.loads(path.read_text(encoding='utf-8'))
    except OSError as error:
        raise EscalatorError(f'{path}: cannot be read: {error.strerror or error}') from error
    except (ValueError, RecursionError) as error:
        raise EscalatorError(f'{path}: not JSON: {error}') from error
    schema = data.get('schema') if isinstance(data, dict) else None
    if not isinstance(schema, str) or not schema.startswith(SCHEMAS):
        raise EscalatorError(
            f'{path}: schema: expected one of {", ".join(s + "1" for s in SCHEMAS)}, '
            f'found {schema!r}'
        )
    return data
