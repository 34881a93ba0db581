"""The metrics as the page tells them: title, one line of meaning, how a value is printed."""

from bisect import bisect
from collections.abc import Callable
from dataclasses import dataclass

from escalator_twin.report.documents import Json, number
from escalator_twin.report.numerals import correlation, fixed, milli, percent

# A cell's shade grows with the distance from agreement, in steps of about a factor of three; it
# repeats the number and decides nothing.
SHORTFALL = (0.001, 0.003, 0.01, 0.03, 0.1)  # of a correlation, from 1 or from its ceiling
RIPPLE = (0.01, 0.03, 0.1, 0.2, 0.4)  # of a ripple's correlation, likewise
RELATIVE = (0.03, 0.1, 0.2, 0.3, 0.5)  # of a difference over a deviation
DELAY_S = (0.002, 0.005, 0.01, 0.02, 0.05)


@dataclass(frozen=True)
class Score:
    """One metric of a channel.

    Attributes
    ----------
    key : str
        In the JSON of `compare`.
    title, meaning : str
    show : callable
        Returns the printed value.
    steps : tuple of float
        Distances from agreement where the shade gets darker.
    distance : callable
        From agreement; gets the value and its ceiling or ``None``.
    show_change : callable
        Returns a printed difference of two values.
    ceiling : str
        Key of the best value that could be reached; empty where there is none.
    """

    key: str
    title: str
    meaning: str
    show: Callable[[float | None], str]
    steps: tuple[float, ...]
    distance: Callable[[float, float | None], float]
    show_change: Callable[[float | None], str]
    ceiling: str = ''

    def shade(self, scores: Json) -> int:
        """Return 0 (agrees) to 5, and 0 where there is no value."""
        value = number(scores.get(self.key))
        if value is None:
            return 0
        best = number(scores.get(self.ceiling)) if self.ceiling else None
        return bisect(self.steps, self.distance(value, best))


def _short(value: float, ceiling: float | None) -> float:
    """Return what a correlation lacks of its ceiling, of 1 where none is known."""
    return 1.0 - value / ceiling if ceiling is not None and ceiling > 0.0 else 1.0 - value


def _size(value: float, _: float | None) -> float:
    return abs(value)


def _change(value: float | None) -> str:
    return fixed(value, 4, sign=True)


def _change_percent(value: float | None) -> str:
    return percent(value, 2, sign=True)


SCORES: dict[str, Score] = {
    score.key: score
    for score in (
        Score(
            'r_time',
            'r in time',
            'Correlation of measured and simulated signal below 2 Hz, aligned by travel. 1 is a '
            'perfect match of shape; a difference of level or of amplitude does not lower it.',
            correlation,
            SHORTFALL,
            _short,
            _change,
            'ceiling_r_time',
        ),
        Score(
            'r_freq',
            'r of spectra',
            'Correlation of the two amplitude spectra up to 2 Hz: the same frequencies with the '
            'same strength, whatever their phase.',
            correlation,
            SHORTFALL,
            _short,
            _change,
        ),
        Score(
            'nrmse',
            'NRMSE',
            'Root mean square difference below 2 Hz, means removed, over the standard deviation '
            'of the measurement. 0 is a perfect match, 100 % as bad as a straight line.',
            percent,
            RELATIVE,
            _size,
            _change_percent,
        ),
        Score(
            'lag_s',
            'Lag',
            'Delay that is left after alignment; positive where the measured signal is later.',
            milli,
            DELAY_S,
            _size,
            milli,
        ),
        Score(
            'ripple_r',
            'r of ripple',
            'Correlation of what is faster than half a cycle per pitch, up to 20 Hz: the '
            'vibration by itself, without the slow course of the load round the loop.',
            correlation,
            RIPPLE,
            _short,
            _change,
            'ripple_ceiling',
        ),
        Score(
            'ripple_nrmse',
            'NRMSE of ripple',
            'Root mean square difference of the ripple over its measured standard deviation.',
            percent,
            RELATIVE,
            _size,
            _change_percent,
        ),
    )
}

CEILINGS = {
    'ceiling_r_time': 'The r in time that the measurement reaches against itself, where a part of '
    'the loop was passed twice: the best that a twin could show. None where less than a quarter '
    'of the loop was passed twice.',
    'ripple_ceiling': 'The same best value for the ripple.',
}


def share(scores: Json, key: str, ceiling: str) -> float | None:
    """Return a score over its ceiling, ``None`` where one of them is missing."""
    value, best = number(scores.get(key)), number(scores.get(ceiling))
    return value / best if value is not None and best is not None and best > 0.0 else None
