"""Digital twin of an instrumented escalator: simulate, compare with recordings, name causes."""

__version__ = '0.1.0'
