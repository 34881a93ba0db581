"""Small still pictures: findings over time, intervals, before beside after."""

from collections.abc import Sequence

from markupsafe import Markup

from escalator_twin.report.documents import Json, number, text
from escalator_twin.report.drawing import tick_label, ticks
from escalator_twin.report.numerals import fixed, percent, words

WIDTH, LABEL = 760, 200
ROW = 20
LEAST_WIDTH = 3.0  # of a finding without length


def timeline(findings: Sequence[Json], until_s: float = 0.0) -> Markup:
    """Return findings over time, a row a channel; empty where none is bound to a time.

    Parameters
    ----------
    findings : sequence of mapping
    until_s : float
        The recording's last sample, where that is known: the axis reaches as far.
    """
    spans = [(f, number(f.get('from_s')), number(f.get('to_s'))) for f in findings]
    known = [
        (f, a, b) for f, a, b in spans if a is not None and b is not None and (a, b) != (0, 0)
    ]
    if not known:
        return Markup()
    low = min(0.0, *(a for _, a, _ in known))
    high = max(until_s, *(b for _, _, b in known))
    names = list(dict.fromkeys(text(f.get('channel')) for f, _, _ in known))
    scale = (WIDTH - LABEL - 12) / ((high - low) or 1.0)
    bottom = ROW * len(names) + 8
    parts = [_seconds(low, high, scale, bottom)]
    for i, name in enumerate(names):
        parts.append(
            Markup('<text class="row" x="{}" y="{}">{}</text>').format(
                LABEL - 8, ROW * i + 18, name or 'whole recording'
            )
        )
    for finding, start, end in known:
        row = names.index(text(finding.get('channel')))
        parts.append(
            Markup(
                '<rect class="finding" x="{:.1f}" y="{}" width="{:.1f}" height="12" rx="2">'
                '<title>{}, {} to {}</title></rect>'
            ).format(
                LABEL + scale * (start - low),
                ROW * row + 8,
                max(scale * (end - start), LEAST_WIDTH),
                words(finding.get('kind')),
                fixed(start, 2, 's'),
                fixed(end, 2, 's'),
            )
        )
    return _svg(WIDTH, bottom + 34, 'findings over time', parts)


def _seconds(low: float, high: float, scale: float, bottom: float) -> Markup:
    marks = ticks(low, high, 8)
    step = marks[1] - marks[0] if len(marks) > 1 else 1.0
    parts = [
        Markup('<path d="M{0:.1f} 4V{1}"/><text class="x" x="{0:.1f}" y="{2}">{3}</text>').format(
            LABEL + scale * (value - low), bottom, bottom + 14, tick_label(value, step)
        )
        for value in marks
    ]
    title = Markup('<text class="x title" x="{}" y="{}">time (s)</text>').format(
        (LABEL + WIDTH) / 2, bottom + 29
    )
    return Markup('<g class="grid">') + Markup('').join(parts) + title + Markup('</g>')


def whisker(name: str, estimate: Json) -> Markup:
    """Return an estimate and its interval on a line that shows where "no effect" is."""
    values = [number(estimate.get(key)) for key in ('low', 'value', 'high')]
    if any(value is None for value in values):
        return Markup()
    low, value, high = (float(v) for v in values if v is not None)
    neutral = 1.0 if name.endswith('factor') else 0.5 if name == 'left_share' else 0.0
    ends = (min(low, neutral), max(high, neutral))
    span = (ends[1] - ends[0]) or 1.0

    def across(at: float) -> float:
        return 8 + 184 * (at - ends[0]) / span

    parts = [
        Markup('<path class="axis" d="M4 10H196"/>'),
        Markup('<path class="neutral" d="M{:.1f} 2V18"/>').format(across(neutral)),
        Markup('<path class="interval" d="M{:.1f} 10H{:.1f}"/>').format(across(low), across(high)),
        Markup('<circle class="value" cx="{:.1f}" cy="10" r="4"/>').format(across(value)),
    ]
    label = f'{words(name)}: interval against no effect at {neutral:g}'
    return _svg(200, 20, label, parts, 'whisker')


def dumbbells(rows: Sequence[tuple[str, float | None, float | None]]) -> Markup:
    """Return shares before and after, a row a channel, on an axis from 0."""
    known = [(name, b, a) for name, b, a in rows if b is not None and a is not None]
    if not known:
        return Markup()
    high = max(max(b, a) for _, b, a in known) or 1.0
    scale = (WIDTH - LABEL - 60) / high
    bottom = ROW * len(known) + 8
    marks = ticks(0.0, high, 6)
    parts = [Markup('<g class="grid">')]
    for value in marks:
        parts.append(
            Markup(
                '<path d="M{0:.1f} 4V{1}"/><text class="x" x="{0:.1f}" y="{2}">{3}</text>'
            ).format(
                LABEL + scale * value, bottom, bottom + 14, percent(value, 0 if high > 0.1 else 1)
            )
        )
    parts.append(Markup('</g>'))
    for i, (name, before, after) in enumerate(known):
        y = ROW * i + 14
        parts.append(
            Markup(
                '<text class="row" x="{}" y="{}">{}</text><path class="bar" d="M{:.1f} {}H{:.1f}"/>'
                '<circle class="before" cx="{:.1f}" cy="{}" r="4.5"/>'
                '<circle class="after" cx="{:.1f}" cy="{}" r="4.5"/>'
            ).format(
                LABEL - 8,
                y + 4,
                name,
                LABEL + scale * before,
                y,
                LABEL + scale * after,
                LABEL + scale * before,
                y,
                LABEL + scale * after,
                y,
            )
        )
    return _svg(WIDTH, bottom + 20, 'NRMSE below 20 Hz, before and after', parts)


def _svg(
    width: float, height: float, label: str, parts: Sequence[Markup], kind: str = 'chart'
) -> Markup:
    head = Markup('<svg class="{}" viewBox="0 0 {} {}" role="img" aria-label="{}">').format(
        kind, width, height, label
    )
    return head + Markup('').join(parts) + Markup('</svg>')
