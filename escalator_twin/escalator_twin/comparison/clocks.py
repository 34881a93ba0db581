"""The loggers' clocks as the time axis takes them."""

from collections.abc import Mapping

from escalator_twin.check.clock import ClockComparison, compare_loggers
from escalator_twin.machine import Machine
from escalator_twin.signals import Finding, Recording
from escalator_twin.sync.timeline import Clock
from escalator_twin.sync.travel import Ground

# Machines within tolerance move the tensioner's phase against the forces' by up to 6 ms and their
# course by up to 15 ppm (generator, eight clean recordings): three times that is a finding.
OFFSET_LIMIT_S = 0.018
DRIFT_LIMIT_PPM = 45.0


def clock_disagreement(moved: Ground | None, known: bool, period_s: float) -> list[Finding]:
    """Compare the clock by bag time with that by the signals, modulo a pitch period.

    Parameters
    ----------
    moved : Ground or None
        How the signals alone would move the reference's clock after bag time tied it.
    known : bool
        Whether bag time tied it.
    period_s : float
        One pitch at the real speed, s.
    """
    if moved is None or not known:
        return []
    shift = (moved.shift_s + 0.5 * period_s) % period_s - 0.5 * period_s
    rate = 1e6 * moved.rate
    is_off = abs(shift) > OFFSET_LIMIT_S + 3.0 * moved.shift_sd_s
    is_off = is_off or abs(rate) > DRIFT_LIMIT_PPM + 3e6 * moved.rate_sd
    if not is_off:
        return []
    text = (
        f'the signals put the on-board clock {1e3 * shift:+.1f} ms and {rate:+.1f} ppm from where '
        f'bag time puts it (modulo {period_s:.3f} s)'
    )
    return [Finding('clock_disagreement', '', 0.0, 0.0, text)]


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
    present = {s.logger for s in instruments.sensors if s.channel in recording.signals}
    clocks, comparisons = {name: Clock() for name in instruments.loggers}, {}
    for name in sorted(present - {reference}):
        found = compare_loggers(recording, machine, name, reference)
        comparisons[name] = found
        if found.offset_s is not None and found.drift_ppm is not None:
            clocks[name] = Clock(found.offset_s, found.drift_ppm * 1e-6)
    return clocks, comparisons
