"""The campaign by factor: what speed, direction, load and preload do to the disagreement."""

from escalator_twin.report.channels import union
from escalator_twin.report.documents import number, Page, table
from escalator_twin.report.factors import Effect, Factor, find_factors, main_effects
from escalator_twin.report.published import speed_error
from escalator_twin.report.scores import Score, SCORES
from escalator_twin.report.section import Context, Section

LEAST_RECORDINGS = 4
TOLD = ('nrmse', 'r_time', 'ripple_nrmse', 'ripple_r', 'lag_s')


def context(page: Page) -> Context | None:
    """Return one table of main effects a metric; nothing for fewer than four recordings."""
    if len(page.recordings) < LEAST_RECORDINGS:
        return None
    factors = find_factors(page.recordings, page.checks)
    if not factors:
        return None
    channels = union([list(entry.data['channels']) for entry in page.recordings])
    errors = [speed_error(entry.data) for entry in page.recordings]
    tables = [(SCORES[key], _table(page, factors, channels, SCORES[key])) for key in TOLD]
    effects = [e for _, rows in tables for _, row in rows for e in row if e is not None]
    return {
        'factors': factors,
        'tables': tables,
        'speed': main_effects(factors, errors),
        'has_margin': any(effect.margin is not None for effect in effects),
        'n': len(page.recordings),
    }


def _table(
    page: Page, factors: tuple[Factor, ...], channels: list[str], score: Score
) -> list[tuple[str, list[Effect | None]]]:
    rows = []
    for channel in channels:
        values = [
            number(table(entry.data['channels'].get(channel)).get(score.key))
            for entry in page.recordings
        ]
        if any(value is not None for value in values):
            rows.append((channel, main_effects(factors, values)))
    return rows


SECTION = Section('factors', 'Agreement by factor', context)
