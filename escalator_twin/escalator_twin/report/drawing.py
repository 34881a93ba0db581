"""A panel as a still SVG picture: what is seen without scripts, and until they have run."""

import math

from markupsafe import Markup
import numpy as np

from escalator_twin.report.stacks import Axis, DRAWN, Panel
from escalator_twin.signals import Floats

WIDTH, LEFT, RIGHT = 760, 58, 8
MAIN, REST, GAP, TOP, BOTTOM = 128, 52, 12, 8, 34
COLUMNS = 300  # of an outline: two points each
FINE = 4  # steps per unit of the picture, so that paths are whole numbers
RESIDUALS = {'simulated': 'residual', 'extended': 'residual-after'}
DECADES = 4.0  # below the largest amplitude, of a logarithmic panel


def still(panel: Panel, axis: Axis) -> Markup:
    """Return a panel over one of its stack's axes."""
    x = panel.x[axis.name]
    bounds = (float(x.min()), float(x.max()))
    main = {name: _shown(panel, panel.y[name]) for name in DRAWN if name in panel.y}
    parts = [_frame(bounds, _limits(panel, list(main.values())), TOP, MAIN, panel.is_log)]
    for name, values in main.items():
        limits = _limits(panel, list(main.values()))
        parts.append(_line(name, x, values, bounds, limits, TOP, MAIN))
    bottom = TOP + MAIN
    if panel.has_residual:
        rests = {
            shown: panel.y['measured'] - panel.y[name]
            for name, shown in RESIDUALS.items()
            if name in panel.y
        }
        limits = _limits(panel, list(rests.values()))
        parts.append(_frame(bounds, limits, bottom + GAP, REST, False, 3))
        for name, rest in rests.items():
            parts.append(_line(name, x, rest, bounds, limits, bottom + GAP, REST))
        bottom += GAP + REST
    parts.append(_abscissa(bounds, bottom, axis))
    height = bottom + BOTTOM
    head = Markup(
        '<svg class="still" viewBox="0 0 {} {}" role="img" aria-label="{}: measured and '
        'simulated over {}">'
    ).format(WIDTH, height, panel.channel, axis.label)
    return head + Markup('').join(parts) + Markup('</svg>')


def _shown(panel: Panel, values: Floats) -> Floats:
    if not panel.is_log:
        return values
    floor = float(np.nanmax(panel.y['measured'])) * 10.0**-DECADES or 1e-12
    return np.log10(np.maximum(values, floor))


def _limits(panel: Panel, columns: list[Floats]) -> tuple[float, float]:
    known = [c[np.isfinite(c)] for c in columns]
    low = min((float(c.min()) for c in known if len(c)), default=0.0)
    high = max((float(c.max()) for c in known if len(c)), default=1.0)
    margin = 0.04 * (high - low) or 1.0
    return (low, high + margin) if panel.is_log else (low - margin, high + margin)


def ticks(low: float, high: float, count: int) -> list[float]:
    """Return round values between two, about ``count`` of them and at least two."""
    step = nice_step((high - low) / max(count, 1))
    if math.floor(high / step) - math.ceil(low / step) < 1:
        step = nice_step(step / 4)
    first = math.ceil(low / step - 1e-9)
    last = math.floor(high / step + 1e-9)
    return [i * step for i in range(first, last + 1)]


def nice_step(raw: float) -> float:
    """Return 1, 2 or 5 times a power of ten, at least ``raw``."""
    if not raw > 0.0:
        return 1.0
    power = 10.0 ** math.floor(math.log10(raw))
    return next(f * power for f in (1.0, 2.0, 5.0, 10.0) if f * power >= raw * (1 - 1e-9))


def tick_label(value: float, step: float) -> str:
    """Return a tick's value with the decimals of its step."""
    digits = max(0, -math.floor(math.log10(step) + 1e-9)) if step > 0 else 0
    shown = f'{value:.{digits}f}'
    return (shown.lstrip('-') if float(shown) == 0.0 else shown).replace('-', '−')


def _frame(
    bounds: tuple[float, float],
    limits: tuple[float, float],
    top: float,
    height: float,
    is_log: bool,
    count: int = 5,
) -> Markup:
    """Return grid lines and labels of an ordinate, and the grid of the abscissa."""
    marks = ticks(*limits, count)
    if is_log:
        marks = [m for m in ticks(*limits, 4) if float(m).is_integer()] or marks
    step = marks[1] - marks[0] if len(marks) > 1 else 1.0
    parts = [Markup('<g class="grid">')]
    for value in ticks(*bounds, 10):
        at = _across(value, bounds)
        parts.append(Markup('<path d="M{:.1f} {}v{}"/>').format(at, top, height))
    for value in marks:
        at = top + height * (limits[1] - value) / (limits[1] - limits[0])
        label = _decade(value) if is_log else tick_label(value, step)
        parts.append(
            Markup('<path d="M{} {:.1f}H{}"/><text x="{}" y="{:.1f}" class="y">{}</text>').format(
                LEFT, at, WIDTH - RIGHT, LEFT - 6, at + 3.5, label
            )
        )
    return Markup('').join(parts) + Markup('</g>')


def _decade(value: float) -> str:
    return '10' + str(round(value)).translate(str.maketrans('-0123456789', '⁻⁰¹²³⁴⁵⁶⁷⁸⁹'))


def _abscissa(bounds: tuple[float, float], bottom: float, axis: Axis) -> Markup:
    marks = ticks(*bounds, 10)
    step = marks[1] - marks[0] if len(marks) > 1 else 1.0
    parts = [
        Markup('<text x="{:.1f}" y="{}" class="x">{}</text>').format(
            _across(value, bounds), bottom + 14, tick_label(value, step)
        )
        for value in marks
    ]
    middle = (LEFT + WIDTH - RIGHT) / 2
    parts.append(
        Markup('<text x="{}" y="{}" class="x title">{} ({})</text>').format(
            middle, bottom + 29, axis.label, axis.unit
        )
    )
    return Markup('<g class="ticks">') + Markup('').join(parts) + Markup('</g>')


def _across(value: float, bounds: tuple[float, float]) -> float:
    return LEFT + (WIDTH - LEFT - RIGHT) * (value - bounds[0]) / ((bounds[1] - bounds[0]) or 1.0)


def _line(
    name: str,
    x: Floats,
    values: Floats,
    bounds: tuple[float, float],
    limits: tuple[float, float],
    top: float,
    height: float,
) -> Markup:
    span = (bounds[1] - bounds[0]) or 1.0
    column = np.minimum((COLUMNS * (x - bounds[0]) / span).astype(int), COLUMNS - 1)
    down = FINE * (top + height * (limits[1] - values) / (limits[1] - limits[0]))
    width = (WIDTH - LEFT - RIGHT) * FINE / COLUMNS
    return Markup('<path class="{}" transform="scale({})" d="{}"/>').format(
        name, 1 / FINE, outline(column, down, LEFT * FINE, width)
    )


def outline(column: np.ndarray, down: Floats, left: float, width: float) -> str:
    """Return a path that goes through the extremes of every column.

    Parameters
    ----------
    column : (n,) int
        Of each sample, ascending.
    down : (n,) float64
        Ordinates; NaN breaks the line.
    left, width : float
        Abscissa of column 0 and width of a column.
    """
    known = np.isfinite(down)
    column, down = column[known], np.round(down[known]).astype(int)
    if not len(column):
        return ''
    starts = np.concatenate([[0], np.flatnonzero(np.diff(column)) + 1])
    lows, highs = np.minimum.reduceat(down, starts), np.maximum.reduceat(down, starts)
    across = np.round(left + width * (column[starts] + 0.5)).astype(int)
    jumps = np.diff(column[starts], prepend=column[starts][0])
    parts = []
    here = (0, 0)
    for i, (at, low, high) in enumerate(zip(across, lows, highs, strict=True)):
        first, second = (low, high) if i % 2 else (high, low)
        if i == 0 or jumps[i] > 3:  # a gap, or samples so far apart that none is
            is_break = i == 0 or len(starts) > COLUMNS // 4
            parts.append(f'M{at} {first}' if is_break else f'L{at} {first}')
        else:
            parts.append(f'l{at - here[0]} {first - here[1]}')
        if second != first:
            parts.append(f'v{second - first}')
        here = (int(at), int(second))
    return ''.join(parts)
