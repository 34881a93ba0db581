"""Walk along the frequencies of a bouncing frame, all else fitted on at every one of them.

A frame just below a multiple of the pitch's frequency and one just above it make that line as strong, and
another mass and other tolerances make up for most of the rest. Between the two lies a frequency at which
the line is far too strong: no step from one leads to the other.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace

from escalator_twin.diagnosis.closing import MOST_LEFT
from escalator_twin.diagnosis.context import Beside, Context
from escalator_twin.diagnosis.frames import HIGHEST_HZ, LOWEST_HZ, NEARLY, RATIO
from escalator_twin.diagnosis.free import freed
from escalator_twin.diagnosis.loops import LOCAL
from escalator_twin.diagnosis.polish import polish, Polished
from escalator_twin.diagnosis.polish import STEPS as FIT_STEPS
from escalator_twin.diagnosis.proposals import Proposal
from escalator_twin.diagnosis.tried import Tried
from escalator_twin.diagnosis.unexplained import excess_of
from escalator_twin.errors import EscalatorError

FRAME, KEY = 'truss_resonance', 'frequency_hz'
POINTS = 6  # of a factor of `frames.RATIO` to either side at most
STEPS = 2  # of a fit at one of them: it begins where its neighbour's ended
# Chi squared above the frame's own: what a frequency may leave more, its fit hardly begun, for it to be fitted to the
# end; and what two of them leave more where the walk ends.
WORTH, ENDS = 2.0 * NEARLY, 8.0 * NEARLY


@dataclass(frozen=True)
class Point:
    """A frequency with what fits best there.

    Attributes
    ----------
    frequency_hz : float
    chi2 : float
        In the channels that a frame is judged by.
    polished : Polished
        The frame last of its effects.
    """

    frequency_hz: float
    chi2: float
    polished: Polished


def frequencies_about(
    polished: Polished, known: Sequence[Proposal], jobs: int = 1
) -> tuple[list[Point], list[Point]]:
    """Return frequencies below and above a frame's own, mass, damping and tolerances fitted at each.

    Parameters
    ----------
    polished : Polished
        Where the walk begins; the frame is the last of its effects.
    known : sequence of Proposal
        All effects but the frame, of machine and measurement.
    jobs : int
        Simulations at a time.
    """
    frame = polished.effects[-1]
    own, level = frame.parameters[KEY], level_of(polished.place)
    fitted = tuple(key for key in frame.fitted if key != KEY)

    def walk(way: int) -> list[Point]:
        there, found = polished, list[Point]()
        for k in range(1, POINTS + 1):
            frequency = own * RATIO ** (way * k)
            is_lost = all(point.chi2 > level + ENDS for point in found[-2:]) and len(found) > 1
            if is_lost or not LOWEST_HZ <= frequency <= HIGHEST_HZ:
                break
            last = there.effects[-1]
            numbers = {**last.parameters, KEY: frequency}
            effects = [*there.effects[:-1], replace(last, parameters=numbers, fitted=fitted)]
            try:
                there = _fitted(there, effects, known, STEPS, max(1, jobs // 2))
            except EscalatorError:
                break
            found.append(Point(frequency, level_of(there.place), there))
        return found

    with ThreadPoolExecutor(min(2, max(1, jobs))) as pool:
        below, above = pool.map(walk, (-1, 1))
    return below, above


def _starts(side: Sequence[Point], level: float) -> list[Point]:
    """Return from where on one side a frame is fitted freely: the farthest that may do, and the best.

    A fit from near the own frequency leads back there.
    """
    able = [point for point in side if point.chi2 <= level + WORTH]
    if not able:
        return []
    best = min(able, key=lambda point: point.chi2)
    return [able[-1]] if best is able[-1] or best.chi2 >= level else [able[-1], best]


def _fitted(
    there: Polished,
    effects: Sequence[Proposal],
    known: Sequence[Proposal],
    steps: int,
    jobs: int,
    anew: bool = False,
) -> Polished:
    """Return effects fitted from the tolerances of a fit that ended near."""
    return polish(
        there.context,
        effects,
        there.place.stage.turned,
        lambda p: freed(p, known),
        anew,
        jobs,
        steps,
        is_near=True,
    )


def level_of(place: Beside) -> float:
    """Return the chi squared that a frame is judged by."""
    return place.stage.judged(place.fitted, FRAME)


def from_other_frequencies(
    context: Context, place: Beside, known: Sequence[Proposal], tried: Tried, jobs: int = 1
) -> Tried:
    """Return a frame's fit, or a better one from another frequency, with those that fit nearly as well.

    Where it explains little of what is open, others are to be found first.

    Parameters
    ----------
    context : Context
        As the search has it.
    place : Beside
        The machine with the known effects.
    known : sequence of Proposal
        Accepted effects, of machine and measurement.
    tried : Tried
        The best of what was fitted.
    jobs : int
        Simulations at a time.
    """
    polished = tried.polished
    if polished is None or tried.proposal.cause != FRAME:
        return tried
    above, left = (excess_of(p, context.floor) for p in (place, polished.place))
    # beside a link, axle or step every run is one at length
    if left >= MOST_LEFT * above or any(k.cause in LOCAL for k in known):
        return tried
    sides = frequencies_about(polished, known, jobs)
    level = level_of(polished.place)
    starts = [point for side in sides for point in _starts(side, level)]

    def freely(point: Point) -> Tried:
        effects = point.polished.effects
        frame = replace(effects[-1], fitted=tried.proposal.fitted)
        try:
            found = _fitted(
                point.polished, [*effects[:-1], frame], known, FIT_STEPS, max(1, jobs // 2), True
            )
        except EscalatorError:
            return tried
        return Tried(
            found.effects[-1], level_of(place) - level_of(found.place), found.sd[-1], found
        )

    with ThreadPoolExecutor(min(2, max(1, jobs))) as pool:
        others = list(pool.map(freely, starts))
    best = max([tried, *others], key=lambda t: t.gain)
    lowest = level_of(place) - best.gain
    points = [(p.frequency_hz, p.chi2) for side in sides for p in side]
    points += [(t.proposal.parameters[KEY], level_of(place) - t.gain) for t in [tried, *others]]
    near = [frequency for frequency, chi2 in points if chi2 <= lowest + WORTH]
    return replace(best, near=(min(near), max(near)))
