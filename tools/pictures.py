"""Draw the README's overlay from a result of ``compare``: no library, one SVG.

escalator-twin compare bags/sample_clean --json out/sample.json
.venv/bin/python tools/pictures.py out/sample.json docs/pictures/overlay.svg
"""

import json
from pathlib import Path
import sys

WIDTH, PANEL, LEFT, GAP = 940, 132, 92, 34
COLOURS = {'measured': '#1f4e8c', 'simulated': '#d1602b'}


def path_of(xs, ys, x_range, y_range, top):
    """Return the SVG path of one curve in its panel."""
    x0, x1 = x_range
    y0, y1 = y_range
    points = [
        f'{LEFT + (x - x0) / (x1 - x0) * (WIDTH - LEFT - 24):.1f},'
        f'{top + (y1 - y) / (y1 - y0) * PANEL:.1f}'
        for x, y in zip(xs, ys, strict=True)
        if y is not None
    ]
    return 'M' + ' L'.join(points)


def panel(name, unit, scores, series, x_range, top, scale):
    """Return one panel: both curves, the channel's name, its scores."""
    curves = {k: [None if v is None else v * scale for v in series[k]] for k in COLOURS}
    known = [v for values in curves.values() for v in values if v is not None]
    low, high = min(known), max(known)
    margin = 0.06 * (high - low)
    y_range = (low - margin, high + margin)
    inside = [i for i, x in enumerate(series['travel_m']) if x_range[0] <= x <= x_range[1]]
    xs = [series['travel_m'][i] for i in inside]
    parts = [
        f'<rect x="{LEFT}" y="{top}" width="{WIDTH - LEFT - 24}" height="{PANEL}" '
        'fill="#fbfbfc" stroke="#c4c9d4"/>',
        f'<text x="{LEFT}" y="{top - 8}" fill="#1c2330">{name} ({unit})</text>',
        f'<text x="{WIDTH - 24}" y="{top - 8}" text-anchor="end" fill="#56607a">'
        f'r below 2 Hz {scores["r_time"]:.4f}, ripple {scores["ripple_r"]:.3f}</text>',
    ]
    for value in (low, high):
        y = top + (y_range[1] - value) / (y_range[1] - y_range[0]) * PANEL
        parts.append(
            f'<text x="{LEFT - 8}" y="{y + 4:.1f}" text-anchor="end" fill="#56607a">'
            f'{value:.3g}</text>'
        )
    for kind, colour in COLOURS.items():
        ys = [curves[kind][i] for i in inside]
        width, dash = (2.6, '') if kind == 'measured' else (1.3, ' stroke-dasharray="5 3"')
        parts.append(
            f'<path d="{path_of(xs, ys, x_range, y_range, top)}" fill="none" '
            f'stroke="{colour}" stroke-width="{width}"{dash}/>'
        )
    return parts


def main(source, target):
    """Write the picture of the first recording in ``source``."""
    recording = json.loads(Path(source).read_text(encoding='utf-8'))['recordings'][0]
    shown = (
        ('link_force/left_a', 'N', 1.0),
        ('tensioner/displacement', 'mm', 1e3),
        ('step/acceleration/z', 'm/s2', 1.0),
    )
    series = recording['overlay']['channels']
    start = min(series[shown[0][0]]['travel_m'])
    x_range = (start, start + 24.3)
    body, top = [], 44
    for name, unit, scale in shown:
        body += panel(name, unit, recording['channels'][name], series[name], x_range, top, scale)
        top += PANEL + GAP
    legend = [
        f'<text x="{LEFT}" y="{top}" fill="{COLOURS["measured"]}">measured (synthetic)</text>',
        f'<text x="{LEFT + 170}" y="{top}" fill="{COLOURS["simulated"]}">simulated</text>',
        f'<text x="{WIDTH - 24}" y="{top}" text-anchor="end" fill="#56607a">'
        'one loop of the chain, 24.3 m of travel</text>',
    ]
    Path(target).write_text(
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {top + 18}" '
        'font-family="Helvetica, Arial, sans-serif" font-size="13">\n'
        f'<rect width="{WIDTH}" height="{top + 18}" fill="#ffffff"/>\n'
        + '\n'.join([*body, *legend])
        + '\n</svg>\n',
        encoding='utf-8',
    )


if __name__ == '__main__':
    main(*sys.argv[1:])
