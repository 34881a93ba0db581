"""Rates with their intervals, and stated probabilities against how often they were right."""

from collections.abc import Sequence
from dataclasses import dataclass

from scipy import stats

BINS = 10  # of the calibration


@dataclass(frozen=True)
class Rate:
    """A share of trials with its 95 % interval by Clopper and Pearson."""

    hits: int
    trials: int
    low: float
    high: float

    @classmethod
    def of(cls, hits: Sequence[bool]) -> 'Rate':
        """Count; without a trial the interval is everything."""
        count, trials = sum(map(bool, hits)), len(hits)
        if not trials:
            return cls(0, 0, 0.0, 1.0)
        interval = stats.binomtest(count, trials).proportion_ci(0.95, method='exact')
        return cls(count, trials, float(interval.low), float(interval.high))

    @property
    def value(self) -> float | None:
        """Hits over trials."""
        return self.hits / self.trials if self.trials else None


@dataclass(frozen=True)
class Calibration:
    """Stated probabilities against how often they were right.

    Attributes
    ----------
    error : float or None
        Expected calibration error: mean over all statements of their bin's difference.
    rows : tuple of (mean probability, share right, count)
        Of every bin that is not empty.
    """

    error: float | None
    rows: tuple[tuple[float, float, int], ...]


def calibration(beliefs: Sequence[tuple[float, bool]], bins: int = BINS) -> Calibration:
    """Sort statements into bins of equal width and compare each bin's means."""
    if not beliefs:
        return Calibration(None, ())
    groups: dict[int, list[tuple[float, bool]]] = {}
    for belief in beliefs:
        groups.setdefault(min(int(belief[0] * bins), bins - 1), []).append(belief)
    rows = tuple(
        (
            sum(p for p, _ in group) / len(group),
            sum(right for _, right in group) / len(group),
            len(group),
        )
        for _, group in sorted(groups.items())
    )
    total = sum(abs(p - share) * count for p, share, count in rows)
    return Calibration(total / len(beliefs), rows)
