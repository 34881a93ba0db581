"""``escalator-twin VERB``: parse, call the verb, write its JSON, check the rules, exit."""

import argparse
from collections.abc import Sequence
from importlib import import_module
import os
import sys
from typing import NoReturn, Protocol

from escalator_twin import __version__
from escalator_twin.cli.options import add_common
from escalator_twin.cli.output import check_writable, Document, dumps, write_text
from escalator_twin.errors import EscalatorError

PROGRAM = 'escalator-twin'
VERBS = {
    'check': 'what is in a recording, and what is wrong with it',
    'simulate': 'run the twin and write a recording',
    'compare': 'the twin beside recordings: synchronisation and metrics',
    'diagnose': 'name what is wrong with the machine, and extend its model',
    'report': 'one HTML page from the JSON of the others',
}
OK, NOT_MET, BAD_INPUT, INTERRUPTED = 0, 1, 2, 130


class Verb(Protocol):
    """What the file of a verb has."""

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Add the verb's own arguments."""

    def run(self, args: argparse.Namespace) -> Document:
        """Do the work and return its document."""

    def show(self, document: Document) -> str:
        """Return the document as text for people."""


class Parser(argparse.ArgumentParser):
    """A parser whose errors are one line."""

    def error(self, message: str) -> NoReturn:
        """Print the error and exit."""
        self.exit(BAD_INPUT, f'{self.prog}: {message}; see {self.prog} --help\n')


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit status.

    Parameters
    ----------
    argv : sequence of str, optional
        Without the program's name; by default the process's own.

    Returns
    -------
    int
        0 done, 1 a ``--require`` is not met, 2 bad input, 130 interrupted.
    """
    words = list(sys.argv[1:] if argv is None else argv)
    try:
        return _run(words)
    except SystemExit as end:  # --help, --version and the parser's errors
        return end.code if isinstance(end.code, int) else OK
    except EscalatorError as error:
        print(f'{PROGRAM}: {_one_line(error)}', file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print(f'{PROGRAM}: interrupted', file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:  # as in `escalator-twin check BAG | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return OK


def _run(words: list[str]) -> int:
    if not words or words[0] not in VERBS:
        _top_parser().parse_args(words)
        raise SystemExit(BAD_INPUT)
    name, *rest = words
    verb: Verb = import_module(f'escalator_twin.cli.{name}')
    parser = Parser(prog=f'{PROGRAM} {name}', description=_sentence(name, verb))
    verb.add_arguments(parser)
    add_common(parser)
    args = parser.parse_args(rest)
    if args.json:
        check_writable(args.json)
    document = verb.run(args)
    if args.json == '-':
        sys.stdout.write(dumps(document))
    else:
        if args.json:
            write_text(args.json, dumps(document))
        sys.stdout.write(verb.show(document))
    sys.stdout.flush()
    broken = [text for rule in args.require for text in rule.broken(document)]
    for text in broken:
        print(f'{PROGRAM} {name}: not met: {text}', file=sys.stderr)
    return NOT_MET if broken else OK


def _top_parser() -> Parser:
    """Return the parser of the words before a verb; it knows the verbs by name only."""
    parser = Parser(prog=PROGRAM, description='Digital twin of an instrumented escalator.')
    parser.add_argument('--version', action='version', version=f'{PROGRAM} {__version__}')
    verbs = parser.add_subparsers(title='verbs', metavar='VERB', required=True)
    for name, text in VERBS.items():
        verbs.add_parser(name, help=text)
    parser.epilog = f'{PROGRAM} VERB --help tells the options of a verb.'
    return parser


def _sentence(name: str, verb: Verb) -> str:
    return (verb.__doc__ or VERBS[name]).strip()


def _one_line(error: Exception) -> str:
    return ' '.join(str(error).split())


if __name__ == '__main__':
    sys.exit(main())
