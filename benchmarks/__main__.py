"""``python -m benchmarks``: all of them; ``python -m benchmarks NAME...``: some."""

from importlib import import_module
import sys

BENCHMARKS = ('simulation', 'peer', 'comparison')


def main() -> int:
    """Run the benchmarks that are named, or all."""
    names = sys.argv[1:] or BENCHMARKS
    unknown = [name for name in names if name not in BENCHMARKS]
    if unknown:
        print(f'{unknown[0]}: expected one of {", ".join(BENCHMARKS)}', file=sys.stderr)
        return 2
    for name in names:
        import_module(f'benchmarks.{name}').main()
    return 0


if __name__ == '__main__':
    sys.exit(main())
