"""One self-contained HTML page from the JSON of `compare`, `check` and `diagnose`."""

from escalator_twin.report.build import build

__all__ = ['build']
