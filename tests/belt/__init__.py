"""Recordings of the second machine by other means than the twin's: it imports nothing of it.

The chain is a row of beads on a curve: their path coordinates are the unknowns, rails and gears are
rigid, a step moves as geometry makes it, and classical Runge-Kutta integrates. The handrail
is a rope in balance. `python -m belt OUT [CAUSE=SIZE...]` from `tests/` writes one recording.
"""
