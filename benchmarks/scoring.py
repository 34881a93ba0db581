"""Score verdicts on recordings whose truth is known: pure functions of the two.

A verdict is the JSON of ``diagnose``, a truth what the generator wrote beside the bag. What counts
as right is written in contracts.md, and nothing of it is taken from the package that is scored.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import dist, exp, hypot, nan, sqrt
from typing import Any

Json = Mapping[str, Any]

LOOP_M = 24.4057  # contracts.md: of the prototype, after which its places come round
PLACE_M = {'s_m': 0.25, 's_from_m': 0.5, 's_to_m': 0.5}  # by which a place may be off
STEPS_OFF = 1
MOST_ALTERNATIVES = 2  # an effect with more counts as not named
UNLISTED = 'unlisted_'
CLEAN, LISTED, NOT_LISTED = 'clean', 'listed', 'unlisted'
NOTHING = 'nothing'  # what the confusion table calls a verdict without a name
# Pairs that one speed cannot tell apart: right under the other's name where it is an alternative.
ALIKE = frozenset({'rolling_resistance', 'friction_speed'})
# Where a parameter says nothing: the size of an effect is its distance from there.
NEUTRAL = {'factor': 1.0, 'load_factor': 1.0, 'left_share': 0.5}
# Parameters that tell the kind of an effect, or when it was, and not how large it is.
OF_KIND = frozenset({
    'frequency_hz', 'cycles_per_pitch', 'damping_ratio', 'length_m', 'speed_m_s', 'phase_rad',
    'from_s', 'to_s',
})  # fmt: skip
SIZED_BY_LENGTH = frozenset({'link_elongation', 'chain_elongation'})
TURNS = ('x_deg', 'y_deg', 'z_deg')
# contracts.md: their nuisance takes most of them before anything is named, so that only held-out samples,
# on which that is no larger than a good instrument's, show them.
OF_MEASUREMENT = frozenset({
    'gauge_gain', 'gauge_drift', 'gauge_dead', 'accelerometer_misalignment', 'axis_inverted',
    'channel_swap', 'clock_drift', 'mains_hum', 'data_gap', 'sensor_spikes',
})  # fmt: skip
FLOOR = 1.0  # of a whitened residual, and of one over the sensor's own noise


@dataclass(frozen=True)
class Truth:
    """What was hidden in a recording.

    Attributes
    ----------
    kind : {'clean', 'listed', 'unlisted'}
    cause : str
        Empty where nothing was hidden.
    location, parameters : mapping
    size : str
        Name of the drawn share of the reference; empty where a cause has no size.
    speed_m_s : float or None
        At which the machine really ran.
    loop_m : float
        Length of its guide, after which places come round.
    """

    kind: str
    cause: str
    location: Json
    parameters: Json
    size: str
    speed_m_s: float | None = None
    loop_m: float = LOOP_M

    @classmethod
    def of(cls, document: Json) -> 'Truth':
        """Read a truth file of the generator in which at most one effect is hidden."""
        truths = cls.all_of(document)
        if not truths:
            return cls(CLEAN, '', {}, {}, '')
        (truth,) = truths
        return truth

    @classmethod
    def all_of(cls, document: Json) -> tuple['Truth', ...]:
        """Read a truth file of the generator, however many effects are hidden."""
        effects = document['effects']
        # the generator joins the sizes of several effects; here they count as one
        return tuple(
            cls(
                NOT_LISTED if effect['cause'].startswith(UNLISTED) else LISTED,
                effect['cause'],
                effect.get('location') or {},
                effect.get('parameters') or {},
                document.get('size') or '',
                document.get('speed_m_s'),
                document.get('loop_m') or LOOP_M,
            )
            for effect in effects
        )


@dataclass(frozen=True)
class Gain:
    """What a verdict says of its gain on samples that no fit has seen.

    Attributes
    ----------
    significant : bool
    left_over : float or None
        Amplitude above the floor that is left, of what was there without the names, in the channel in which most
        falls; None where nothing was above the floor.
    """

    significant: bool
    left_over: float | None


@dataclass(frozen=True)
class Outcome:
    """What one verdict was worth.

    Attributes
    ----------
    truth : Truth
    named : str
        First cause that was named; ``nothing`` where none was.
    cause_right, place_right : bool
        Of the first cause; a place only of the right cause.
    flagged : bool
        Something unexplained is significant.
    size_errors, value_errors : tuple of float
        Of a right cause at the right place: over the effect's own size, and over the value.
    covered : tuple of bool
        Of every parameter of such an effect: the interval holds the truth.
    belief : (float, bool) or None
        Probability of the best cause and place that was weighed, and whether it is right.
    seconds : float
    failed : bool
        There is no verdict: this counts against every rate.
    gain : Gain or None
        Of a right cause at the right place; None without a second look.
    """

    truth: Truth
    named: str
    cause_right: bool
    place_right: bool
    flagged: bool
    size_errors: tuple[float, ...] = ()
    value_errors: tuple[float, ...] = ()
    covered: tuple[bool, ...] = ()
    belief: tuple[float, bool] | None = None
    seconds: float = 0.0
    failed: bool = False
    gain: Gain | None = None

    @property
    def abstained(self) -> bool:
        """A verdict that names nothing."""
        return self.named == NOTHING and not self.failed


def judge(truth: Truth, verdict: Json | None, seconds: float = 0.0) -> Outcome:
    """Hold a verdict against the truth; None where there is no verdict."""
    if verdict is None:
        return Outcome(truth, NOTHING, False, False, False, seconds=seconds, failed=True)
    effects = [e for e in verdict['effects'] if len(e['alternatives']) <= MOST_ALTERNATIVES]
    flagged = bool(verdict['unexplained']['significant'])
    belief = belief_of(truth, verdict)
    if not effects:
        return Outcome(truth, NOTHING, False, False, flagged, belief=belief, seconds=seconds)
    first = effects[0]
    cause = is_cause(truth, first)
    place = cause and is_place(truth, first['location'])
    rows = sizes(truth, first) if place else []
    return Outcome(
        truth,
        first['cause'],
        cause,
        place,
        flagged,
        tuple(row.error for row in rows if row.error is not None),
        tuple(row.value_error for row in rows if row.value_error is not None),
        tuple(hit for row in rows for hit in row.covered),
        belief,
        seconds,
        gain=gain_of(verdict) if place else None,
    )


def gain_of(verdict: Json) -> Gain | None:
    """Return what a verdict on one recording tells of its gain; None without a second look."""
    held = (verdict.get('gain') or {}).get('held_out')
    if held is None:
        return None
    rows = [(row['chi2_before'], row['chi2_after']) for row in held['channels'].values()]
    if verdict['effects'][0]['cause'] not in OF_MEASUREMENT:
        split = verdict['by_recording'][0]['residual']
        rows = [
            (row['chi2'], split['after'][name]['chi2']) for name, row in split['before'].items()
        ]
    before, after = max(rows, key=lambda row: row[0] - row[1])
    left = None if before <= FLOOR else sqrt(max(after - FLOOR, 0.0) / (before - FLOOR))
    return Gain(bool(held['significant']), left)


@dataclass(frozen=True)
class Together:
    """What one verdict on several hidden effects was worth.

    Attributes
    ----------
    truths : tuple of Truth
    right : tuple of bool
        Of every hidden effect: it is named, at its place.
    errors : tuple of float
        Of the right ones: the largest error over the effect's own size; nan without a size.
    others : tuple of str
        Causes that are named and not hidden.
    seconds : float
    failed : bool
    """

    truths: tuple[Truth, ...]
    right: tuple[bool, ...]
    errors: tuple[float, ...]
    others: tuple[str, ...]
    seconds: float = 0.0
    failed: bool = False


def judge_together(
    truths: Sequence[Truth], verdict: Json | None, seconds: float = 0.0
) -> Together:
    """Hold a verdict against all that is hidden; None where there is no verdict."""
    rows = tuple(truths)
    if verdict is None:
        return Together(rows, (False,) * len(rows), (), (), seconds, failed=True)
    left = [e for e in verdict['effects'] if len(e['alternatives']) <= MOST_ALTERNATIVES]
    right, errors = [], []
    for truth in rows:
        own = next(
            (e for e in left if is_cause(truth, e) and is_place(truth, e['location'])),
            None,
        )
        right.append(own is not None)
        if own is not None:
            left.remove(own)
            known = [row.error for row in sizes(truth, own) if row.error is not None]
            errors.append(max(known, default=nan))
    others = tuple(e['cause'] for e in left)
    return Together(rows, tuple(right), tuple(errors), others, seconds)


def is_cause(truth: Truth, effect: Json) -> bool:
    """Tell whether an effect has the right name."""
    if effect['cause'] == truth.cause:
        return True
    pair = {effect['cause'], truth.cause}
    return pair == ALIKE and truth.cause in effect['alternatives']


def is_place(truth: Truth, found: Json) -> bool:
    """Tell whether every key of the true place is right."""
    return all(
        key in found and is_key(key, value, found[key], truth.loop_m)
        for key, value in truth.location.items()
    )


def is_key(key: str, true: Any, found: Any, loop_m: float) -> bool:
    """Tell whether one key of a place is right, on a guide of that length."""
    if key in PLACE_M:
        away = abs(float(true) - float(found)) % loop_m
        return min(away, loop_m - away) <= PLACE_M[key]
    if key == 'steps':
        return len(set(true) ^ set(found)) <= STEPS_OFF
    if isinstance(true, list | tuple):
        return set(true) == set(found)
    return bool(true == found)


@dataclass(frozen=True)
class Size:
    """How far one number of an effect is off, and whether its intervals hold the truth."""

    error: float | None
    value_error: float | None
    covered: tuple[bool, ...]


def sizes(truth: Truth, effect: Json) -> list[Size]:
    """Compare all numbers that truth and verdict share."""
    true, found = dict(truth.parameters), effect['parameters']
    if effect['cause'] != truth.cause:
        true = as_named(truth, effect['cause'], found)
    rows = []
    if all(name in true and name in found for name in TURNS):
        one = [true.pop(name) for name in TURNS]
        error = dist(one, [found[name]['value'] for name in TURNS]) / hypot(*one)
        hits = tuple(holds(found[name], value) for name, value in zip(TURNS, one, strict=True))
        rows.append(Size(error, error, hits))
    for name, value in true.items():
        if name not in found:
            continue
        hit = (holds(found[name], value),)
        if name in OF_KIND and not (name == 'length_m' and truth.cause in SIZED_BY_LENGTH):
            rows.append(Size(None, None, hit))
            continue
        away = abs(found[name]['value'] - value)
        size = abs(value - NEUTRAL.get(name, 0.0))
        rows.append(Size(away / size if size else None, away / abs(value) if value else None, hit))
    return rows


def as_named(truth: Truth, name: str, found: Json) -> dict[str, float]:
    """Return the truth in the numbers of the cause that cannot be told apart from it.

    friction_speed is rolling resistance times 1 + rise exp(-v / speed), with the speed v of the
    run.
    """
    if truth.speed_m_s is None:
        return {}
    if name == 'rolling_resistance':
        rise, scale = truth.parameters['rise'], truth.parameters['speed_m_s']
        return {'factor': 1.0 + rise * exp(-truth.speed_m_s / scale)}
    if 'speed_m_s' not in found:
        return {}
    scale = found['speed_m_s']['value']
    return {'rise': (truth.parameters['factor'] - 1.0) / exp(-truth.speed_m_s / scale)}


def holds(interval: Json, value: float) -> bool:
    """Tell whether an interval holds a value."""
    return bool(interval['low'] <= value <= interval['high'])


def belief_of(truth: Truth, verdict: Json) -> tuple[float, bool] | None:
    """Return the probability of the best that was weighed, and whether it is right."""
    best = (verdict['effects'] or verdict['candidates'] or [None])[0]
    if best is None:
        return None
    alike = {best['cause'], truth.cause} == ALIKE
    right = best['cause'] == truth.cause or alike
    return float(best['probability']), right and is_place(truth, best['location'])


def confusion(outcomes: Sequence[Outcome]) -> dict[str, dict[str, int]]:
    """Count what was named by what was hidden."""
    table: dict[str, dict[str, int]] = {}
    for outcome in outcomes:
        row = table.setdefault(outcome.truth.cause or CLEAN, {})
        named = 'no verdict' if outcome.failed else outcome.named
        row[named] = row.get(named, 0) + 1
    return {
        name: dict(sorted(row.items(), key=lambda item: (-item[1], item[0])))
        for name, row in sorted(table.items())
    }
