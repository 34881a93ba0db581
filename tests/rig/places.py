"""How places and sizes of what can be hidden are drawn from a seed and a share of the reference."""

from collections.abc import Callable
from dataclasses import dataclass
from math import floor
from typing import Any

import numpy as np

from rig.guide import lay_path
from rig.instruments import LINKS
from rig.sheet import chosen

Random = np.random.Generator
Draw = Callable[[Random, float], tuple[dict[str, Any], dict[str, Any]]]

ONE_SIDE = ('left', 'right')
ANY_SIDE = ('left', 'right', 'both')


@dataclass(frozen=True)
class Kind:
    """A cause that can be drawn; ``needs_load`` where an empty machine does not show it."""

    draw: Draw
    needs_load: bool = False
    has_size: bool = True


def loop_m() -> float:
    """Return along how many metres of the guide places lie, to a decimetre."""
    return floor(10.0 * lay_path(chosen()).start[-1]) / 10.0


def any_s(rng: Random) -> float:
    """Return a place along the guide (m), to a centimetre."""
    return round(rng.uniform(0.0, loop_m()), 2)


def any_link(rng: Random) -> int:
    """Return a link of the chain, an axle or a step."""
    return int(rng.integers(chosen().links))


def pick(rng: Random, choices: tuple) -> Any:
    """Return one of the choices as it is."""
    return choices[int(rng.integers(len(choices)))]


def factor(reference: float, share: float) -> float:
    """Return a factor whose distance from 1 is the reference's times ``share``."""
    return 1.0 + share * (reference - 1.0)


def softer(reference: float, share: float) -> float:
    """Return a factor that stays above 0: the reference to the power ``share``."""
    return reference**share


def of_machine(**sizes: Callable[[Random, float], float]) -> Draw:
    """Return a draw without a place."""
    return lambda rng, share: ({}, {k: size(rng, share) for k, size in sizes.items()})


def at_roller(name: str, reference: float) -> Draw:
    """Return a draw of one roller."""

    def draw(rng: Random, share: float) -> tuple[dict, dict]:
        place = {'axle': any_link(rng), 'side': pick(rng, ONE_SIDE)}
        return place, {name: share * reference}

    return draw


def at_link(**sizes: Callable[[Random, float], float]) -> Draw:
    """Return a draw of one gauged link."""
    return lambda rng, share: (
        {'link': pick(rng, LINKS)},
        {k: size(rng, share) for k, size in sizes.items()},
    )


def at_axis(**sizes: Callable[[Random, float], float]) -> Draw:
    """Return a draw of one of the accelerometer's axes."""
    return lambda rng, share: (
        {'axis': pick(rng, ('x', 'y', 'z'))},
        {k: size(rng, share) for k, size in sizes.items()},
    )


def in_stretch(lengths_m: tuple[float, float], **sizes: Callable[[Random, float], float]) -> Draw:
    """Return a draw of a stretch of the guide that does not cross the seam."""

    def draw(rng: Random, share: float) -> tuple[dict, dict]:
        length = rng.uniform(*lengths_m)
        start = rng.uniform(0.0, loop_m() - length)
        place = {'s_from_m': round(start, 2), 's_to_m': round(start + length, 2)}
        return place, {k: size(rng, share) for k, size in sizes.items()}

    return draw


def with_side(draw: Draw, sides: tuple[str, ...] = ANY_SIDE) -> Draw:
    """Return the draw with a side among its places."""

    def sided(rng: Random, share: float) -> tuple[dict, dict]:
        place, size = draw(rng, share)
        return {**place, 'side': pick(rng, sides)}, size

    return sided


def times(reference: float) -> Callable[[Random, float], float]:
    """Return a size in proportion to the share."""
    return lambda _rng, share: share * reference


def either(*references: float) -> Callable[[Random, float], float]:
    """Return a factor from one of several references."""
    return lambda rng, share: factor(pick(rng, references), share)


def between(low: float, high: float) -> Callable[[Random, float], float]:
    """Return a number that does not scale with the share."""
    return lambda rng, _share: float(rng.uniform(low, high))
