"""The loggers' clocks as the time axis takes them."""

from collections.abc import Mapping

from escalator_twin.check.clock import ClockComparison, compare_loggers
from escalator_twin.machine import Machine
from escalator_twin.signals import Recording
from escalator_twin.sync.timeline import Clock


def logger_clocks(
    recording: Recording, machine: Machine
) -> tuple[Mapping[str, Clock], Mapping[str, ClockComparison]]:
    """Compare every logger that has samples with the reference logger, by bag time.

    Returns
    -------
    clocks : mapping of logger to Clock
        Neutral for the reference, and where bag time cannot tell.
    comparisons : mapping of logger to ClockComparison
        For the loggers beside the reference.
    """
    instruments = machine.instruments
    reference = instruments.reference_logger
    present = {
        s.logger for s in instruments.sensors if s.channel in recording.signals
    }
    clocks, comparisons = {name: Clock() for name in instruments.loggers}, {}
    for name in sorted(present - {reference}):
        found = compare_loggers(recording, machine, name, reference)
        comparisons[name] = found
        if found.offset_s is not None and found.drift_ppm is not None:
            clocks[name] = Clock(found.offset_s, found.drift_ppm * 1e-6)
    return clocks, comparisons
