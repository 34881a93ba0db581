"""Line plots as plain SVG, for docs/verification.md."""

from dataclasses import dataclass
from math import floor, log10
from xml.sax.saxutils import escape

import numpy as np

from escalator_twin.signals import Floats

WIDTH, HEIGHT, LEFT, TOP, RIGHT, BOTTOM = 640, 300, 62, 34, 16, 48
COLOURS = ('#222222', '#c0392b', '#2471a3', '#1e8449')
DASHES = ('', '', '6 3', '2 3')
LETTER, GAP = 5.6, 14.0  # of the legend
MOST_POINTS = 600
TICKS = 6


@dataclass(frozen=True)
class Line:
    """One curve of a plot.

    Attributes
    ----------
    label : str
    x, y : (n,) float64
    """

    label: str
    x: Floats
    y: Floats


def ticks(low: float, high: float) -> list[float]:
    """Return round numbers between two."""
    raw = (high - low) / TICKS
    power = 10.0 ** floor(log10(raw))
    step = next(f * power for f in (1.0, 2.0, 5.0, 10.0) if f * power >= raw)
    first = np.ceil(low / step)
    return [float(t) + 0.0 for t in np.arange(first, high / step + 1e-9) * step]


def svg(title: str, x_label: str, y_label: str, lines: list[Line]) -> str:
    """Return a plot of lines as the text of an SVG file."""
    x = np.concatenate([line.x for line in lines])
    y = np.concatenate([line.y for line in lines])
    margin = 0.06 * float(np.ptp(y))
    (x0, x1), (y0, y1) = (x.min(), x.max()), (y.min() - margin, y.max() + margin)

    def across(value: Floats | float) -> Floats | float:
        return LEFT + (value - x0) / (x1 - x0) * (WIDTH - LEFT - RIGHT)

    def down(value: Floats | float) -> Floats | float:
        return HEIGHT - BOTTOM - (value - y0) / (y1 - y0) * (HEIGHT - TOP - BOTTOM)

    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" '
        f'font-family="sans-serif" font-size="11">',
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="white"/>',
        _text(LEFT, 16, title, size=13),
        _text(WIDTH - RIGHT, HEIGHT - BOTTOM + 26, x_label, anchor='end'),
        _text(LEFT, TOP - 6, y_label),
    ]
    for at in ticks(x0, x1):
        parts.append(_rule(across(at), TOP, across(at), HEIGHT - BOTTOM))
        parts.append(_text(across(at), HEIGHT - BOTTOM + 14, f'{at:g}', anchor='middle'))
    for at in ticks(y0, y1):
        parts.append(_rule(LEFT, down(at), WIDTH - RIGHT, down(at)))
        parts.append(_text(LEFT - 5, down(at) + 4, f'{at:g}', anchor='end'))
    legend = float(LEFT)
    for i, line in enumerate(lines):
        keep = slice(None, None, max(1, len(line.x) // MOST_POINTS))
        points = zip(np.asarray(across(line.x))[keep], np.asarray(down(line.y))[keep], strict=True)
        path = ' '.join(f'{a:.1f},{b:.1f}' for a, b in points)
        parts.append(
            f'<polyline fill="none" stroke="{COLOURS[i]}" stroke-width="1.5" '
            f'stroke-dasharray="{DASHES[i]}" points="{path}"/>'
        )
        parts.append(_text(legend, HEIGHT - 8, line.label, fill=COLOURS[i]))
        legend += LETTER * len(line.label) + GAP
    return '\n'.join([*parts, '</svg>', ''])


def _text(
    x: Floats | float,
    y: Floats | float,
    text: str,
    anchor: str = 'start',
    size: int = 11,
    fill: str = 'black',
) -> str:
    return (
        f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" font-size="{size}" '
        f'fill="{fill}">{escape(text)}</text>'
    )


def _rule(x0: Floats | float, y0: Floats | float, x1: Floats | float, y1: Floats | float) -> str:
    return (
        f'<line x1="{x0:.1f}" y1="{y0:.1f}" x2="{x1:.1f}" y2="{y1:.1f}" '
        f'stroke="#dddddd" stroke-width="0.7"/>'
    )
