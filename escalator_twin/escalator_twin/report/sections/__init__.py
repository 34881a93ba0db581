"""The sections of the page, in their order; a new one is a file, a template and a line here."""

from escalator_twin.report.section import Section
from escalator_twin.report.sections import (
    agreement,
    by_recording,
    candidates,
    check,
    effects,
    extension,
    factors,
    gain,
    published,
    quality,
    recordings,
    residual,
    ride,
    setting,
    sources,
    summary,
    unexplained,
)

SECTIONS: tuple[Section, ...] = (
    summary.SECTION,
    effects.SECTION,
    candidates.SECTION,
    gain.SECTION,
    unexplained.SECTION,
    residual.SECTION,
    by_recording.SECTION,
    extension.SECTION,
    agreement.SECTION,
    factors.SECTION,
    published.SECTION,
    setting.SECTION,
    ride.SECTION,
    quality.SECTION,
    recordings.SECTION,
    check.SECTION,
    sources.SECTION,
)

__all__ = ['SECTIONS']
