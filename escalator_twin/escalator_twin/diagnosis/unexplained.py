"""What no cause accounts for: whether it is beyond the twin's own error, and what it is like."""

from collections.abc import Callable, Container
from dataclasses import dataclass
from typing import Any

import numpy as np

from escalator_twin.diagnosis.context import Beside, Context
from escalator_twin.diagnosis.floor import Floor, kind_of, SHAKING
from escalator_twin.diagnosis.nuisance import CREEP
from escalator_twin.diagnosis.search_whole import LIKE_KNOBS
from escalator_twin.diagnosis.split import comb_shares, in_time, loop_correlation
from escalator_twin.diagnosis.verdict import EFFECT_TOLERANCES
from escalator_twin.diagnosis.view import NO_PROBES, View
from escalator_twin.diagnosis.whitening import frequencies
from escalator_twin.signals import Floats

SIGMAS = 3.0  # of a normal number: one channel in a thousand, eight channels: 1 % of recordings
OPEN_SIGMAS = 2.0  # from which the search for a further effect is worth its time
PEAKS = 3
# Of what is above a good machine's: beside effects that account for less nothing is named.
LEAST_EXPLAINED = 0.4
# Of the same: beside effects that account for less than the first a name has no belief left, and from the second on it is
# told as it is. A sure name is one no more where 35 % is open: a bent axle, on no list, seems a soft link that leaves 37 %.
NO_BELIEF, FULL_BELIEF = 0.5, 0.8
LEAST_SHARE = 0.05  # of the excess, from which a channel is told
STAND_FOR = frozenset(knob for knob, _ in LIKE_KNOBS.values())
SAME_LOOP = 0.3  # correlation of two passages from which a residual is locked to the loop


@dataclass(frozen=True)
class Unexplained:
    """The remainder of one recording.

    Attributes
    ----------
    significant : bool
        Beyond what the twin's error and the tolerances give, at 1 %.
    share : float
        Of the whitened residual energy before any cause.
    explained : float
        How much of the energy above the floor, or of chi squared above a good machine's, the effects
        account for.
    signature : mapping
    above : float
        Chi squared above a good machine's, see `excess_of`.
    above_shaken : float
        The same of the channels that rattling rollers shake.
    """

    significant: bool
    share: float
    explained: float
    signature: dict[str, Any]
    above: float = 0.0
    above_shaken: float = 0.0

    def beside(self, cause: str) -> float:
        """Return the chi squared above a good machine's, in the channels that speak for a cause."""
        return self.above + (self.above_shaken if cause in SHAKING else 0.0)


# Of what is open in channels that rattling shakes: what fell by less in all others is no part of it. With accelerometers
# alone a mass of some hundredths of it was told with 0.99 beside a dragging roller, all of it open (development).
LEAST_PART = 0.1
NOT_JUDGED = Unexplained(False, 0.0, 0.0, {})  # of a recording that no machine was put beside


def belief_beside(explained: float) -> float:
    """Return what is left of a name's probability beside the share of what is above a good machine's that names explain."""
    return min(max((explained - NO_BELIEF) / (FULL_BELIEF - NO_BELIEF), 0.0), 1.0)


def by_channel(place: Beside, left: np.ndarray | None = None) -> Floats:
    """Return chi squared per coefficient of every channel, nuisance taken out, (c,); of another residual where given."""
    left = place.fitted.left() if left is None else left
    rows = left.astype(np.float64).reshape(-1, len(place.stage.observation.channels))
    return np.asarray(place.stage.whiten.temperature * np.mean(rows**2, axis=0))


def levels_of(place: Beside, floor: Floor) -> Floats:
    """Return the chi squared of a good machine's channels, (c,)."""
    return np.exp([floor.level_of(kind) for kind in _kinds(place)])


def limits_of(place: Beside, floor: Floor, sigmas: float) -> Floats:
    """Return what a good machine passes as seldom as a normal number passes ``sigmas``, (c,)."""
    return np.exp([floor.limit(kind, sigmas) for kind in _kinds(place)])


def _kinds(place: Beside) -> list[str]:
    instruments = place.stage.machine.instruments
    return [kind_of(instruments.sensor(c)) for c in place.stage.observation.channels]


def is_open(place: Beside, floor: Floor, sigmas: float = OPEN_SIGMAS) -> bool:
    """Tell whether any channel holds more than a good machine's usually does."""
    return bool((by_channel(place) > limits_of(place, floor, sigmas)).any())


def is_stretched(place: Beside) -> bool:
    """Tell whether an instrument's nuisance is fitted larger than a good instrument has it.

    A gauge's gain hardly resists: 20 of its tolerances cost less than the remainder that they hide. No more does
    its creep, whose shapes together are its size.
    """
    is_beyond = _beyond(place, lambda name: name.endswith('/gain') or name.startswith('rotation/'))
    return is_beyond or _creeps(place)


def _creeps(place: Beside) -> bool:
    creeps: dict[str, float] = {}
    sizes = place.fitted.sizes + place.fitted.offset
    # what was freed for an effect has a column behind all names, or a name of its own
    for name, size in zip(place.stage.nuisance.names, sizes, strict=False):
        channel, is_creep, _ = name.partition(CREEP)
        if is_creep:
            creeps[channel] = creeps.get(channel, 0.0) + float(size)
    return any(abs(size) > EFFECT_TOLERANCES for size in creeps.values())


def is_used_up(place: Beside, but: Container[str] = ()) -> bool:
    """Tell whether a tolerance that a cause stands for is fitted larger than a good machine has it.

    Rolling resistance, springs, preload and landings resist as little: six of their tolerances cost 36 of chi
    squared, and beside what was found nothing is open. ``but`` holds those that accepted effects stand for.
    """
    return any(name not in but for name in beyond_tolerance(place))


def holds_more(place: Beside, floor: Floor, stood_for: Container[str] = ()) -> bool:
    """Tell whether a further effect may be there: in what is left, or hidden in a tolerance or an instrument's nuisance.

    ``stood_for`` holds the tolerances that accepted effects stand for.
    """
    return is_open(place, floor) or is_stretched(place) or is_used_up(place, stood_for)


def beyond_tolerance(place: Beside) -> dict[str, float]:
    """Return the tolerances that a cause stands for and that are fitted larger than a good machine has them.

    In standard deviations, what the run holds of them and what is fitted beyond that.
    """
    whole = _whole(place)
    return {n: z for n, z in whole.items() if n in STAND_FOR and abs(z) > EFFECT_TOLERANCES}


def _beyond(place: Beside, held: Callable[[str], bool]) -> bool:
    return any(abs(z) > EFFECT_TOLERANCES for name, z in _whole(place).items() if held(name))


def _whole(place: Beside) -> dict[str, float]:
    """Return every nuisance's size: what the run holds of a tolerance already, and what is fitted beyond that."""
    sizes = place.fitted.sizes + place.fitted.offset
    return {n: float(z) for n, z in zip(place.stage.nuisance.names, sizes, strict=False)}


def excess_of(place: Beside, floor: Floor, shaken: bool = False) -> float:
    """Return chi squared above a good machine's, in the channels that rattling shakes or the others."""
    level = levels_of(place, floor)
    chosen = ~place.stage.quiet if shaken else place.stage.quiet
    above = np.maximum(by_channel(place) - level, 0.0)[chosen]
    n = len(place.fitted.white) / len(level)
    return float(n * above.sum() / place.stage.whiten.temperature)


def look(context: Context, before: Beside, after: Beside) -> Unexplained:
    """Judge what is left.

    Parameters
    ----------
    context : Context
    before, after : Beside
        The machine as described, and with its effects.
    """
    first, last = by_channel(before), by_channel(after)
    floor = levels_of(after, context.floor)
    significant = bool((last > limits_of(after, context.floor, SIGMAS)).any())
    excess = float(np.maximum(last - floor, 0.0).sum())
    share = float(np.clip(excess / max(float(first.sum()), 1e-12), 0.0, 1.0))
    signature = signature_of(context, after, last, floor) if significant else {}
    return Unexplained(
        significant,
        share if significant else 0.0,
        explained_by(before, after, context.floor),
        signature,
        excess_of(after, context.floor),
        excess_of(after, context.floor, shaken=True),
    )


def fell_by(before: Beside, after: Beside) -> float:
    """Return by how much chi squared fell, in the channels that no rattling shakes."""
    return max(before.stage.judged(before.fitted) - after.stage.judged(after.fitted), 0.0)


def explained_by(before: Beside, after: Beside, floor: Floor) -> float:
    """Return how much of what is above a good machine's the effects account for, 0 to 1.

    By energy or by chi squared, whichever is more: what a tolerance or a gauge's own nuisance had taken
    before counts by what it took to do so. Not where rattling channels are open and hold far more than that: it was
    no part of what is open.
    """
    level = levels_of(after, floor)
    whole, excess = (
        float(np.maximum(by_channel(place) - level, 0.0).sum()) for place in (before, after)
    )
    fell = fell_by(before, after)
    by_chi2 = fell / max(fell + excess_of(after, floor), 1e-12)
    is_shaken = (by_channel(after) > limits_of(after, floor, SIGMAS))[~after.stage.quiet].any()
    if is_shaken and fell < LEAST_PART * excess_of(after, floor, shaken=True):
        by_chi2 = 0.0
    return float(np.clip(max(1.0 - excess / max(whole, 1e-12), by_chi2), 0.0, 1.0))


def signature_of(context: Context, place: Beside, chi2: Floats, floor: Floats) -> dict[str, Any]:
    """Return which channels the remainder is in, where it sits and what it repeats with."""
    observation = place.stage.observation
    c = len(observation.channels)
    left = place.fitted.left().astype(np.float64).reshape(-1, c)
    excess = np.maximum(chi2 - floor, 0.0)
    main = int(np.argmax(excess))
    f = frequencies(len(observation.index), observation.frame.rate_hz)[: len(left)]
    power = left[:, main] ** 2
    smooth = np.convolve(power, np.ones(5) / 5.0, 'same')
    peaks: list[float] = []
    for k in np.argsort(-smooth):
        if all(abs(f[k] - p) > 0.1 for p in peaks):
            peaks.append(float(f[k]))
        if len(peaks) == PEAKS:
            break
    pitch_hz = observation.frame.speed_m_s / observation.frame.pitch_m
    comb = float(comb_shares(place)[main])
    time = in_time(place)
    loop = loop_correlation(time[:, main], observation.frame.n_loop)
    locked = []
    if comb > 0.5:
        locked.append('travel')
    if loop is not None and loop > SAME_LOOP:
        locked.append('place in the loop: guide or link')
    if loop is not None and loop <= SAME_LOOP and comb <= 0.5:
        locked.append('time')
    energy = np.convolve(time[:, main] ** 2, np.ones(25) / 25.0, 'same')
    # a place needs no probes
    view = View(observation, context.responses, context.setting.experiment.direction, NO_PROBES)
    at = int(np.argmax(energy))
    return {
        'channels': {
            name: round(float(value), 3)
            for name, value in zip(
                observation.channels, excess / max(excess.sum(), 1e-30), strict=True
            )
            if value > LEAST_SHARE
        },
        'locked_to': locked or ['unknown'],
        'frequencies_hz': [round(p, 3) for p in peaks],
        'cycles_per_pitch': [round(p / pitch_hz, 3) for p in peaks],
        'pitch_multiples_share': round(comb, 3),
        'loop_correlation': None if loop is None else round(loop, 3),
        'largest_at_s_m': round(float(view.place_of(0)[at]), 2),
        'largest_at_time_s': round(float(observation.time_s[at, main]), 2),
    }
