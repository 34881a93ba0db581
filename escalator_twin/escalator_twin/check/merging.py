"""Join what was found in successive windows into what is true of the whole recording."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
import re

from escalator_twin.check.gaps import STILL
from escalator_twin.signals import Finding

NUMBER = re.compile(r'\d+')
COUNTED = re.compile(r'\d+ (messages|samples) ')
SATURATED = re.compile(r'(.*?)(\d+) samples at the (largest|smallest) value, (\S+)')


def merge_reading(
    findings: Sequence[Finding], missing: Sequence[Mapping[str, Finding]]
) -> list[Finding]:
    """Join the findings of reading: counts add, what is said again is said once.

    Parameters
    ----------
    findings : sequence of Finding
        Of all windows, in the time of the recording, without missing channels.
    missing : sequence of mappings
        Of each window: the channels that it does not have.
    """
    always = [f for c, f in missing[0].items() if all(c in window for window in missing)]
    groups: dict[tuple[str, str, str], list[Finding]] = {}
    for finding in findings:
        text = finding.detail
        if COUNTED.match(text):
            text = NUMBER.sub('#', text.split(',')[0])
        groups.setdefault((finding.kind, finding.channel, text), []).append(finding)
    return always + [_over(group, _sum(group)) for group in groups.values()]


def _sum(group: Sequence[Finding]) -> str:
    """Return the longest text with the sums of all counts."""
    text = max((f.detail for f in group), key=lambda detail: detail.count(','))
    if not COUNTED.match(text):
        return group[0].detail
    counts = [[int(n) for n in NUMBER.findall(f.detail)] for f in group]
    totals = iter(
        [
            sum(row[i] for row in counts if i < len(row))
            for i in range(max(len(row) for row in counts))
        ]
    )
    return NUMBER.sub(lambda _: str(next(totals)), text)


def _over(group: Sequence[Finding], text: str) -> Finding:
    """Return one finding from the first's begin to the last's end."""
    begin, end = min(f.from_s for f in group), max(f.to_s for f in group)
    return replace(group[0], from_s=begin, to_s=end, detail=text)


def merge_values(findings: Sequence[Finding], touch_s: float) -> list[Finding]:
    """Join what one channel's samples show in successive windows.

    Parameters
    ----------
    findings : sequence of Finding
        In the time of the recording.
    touch_s : float
        Standing still counts as one where it goes on after less than this.
    """
    still = [f for f in findings if f.detail.startswith(STILL)]
    groups: dict[tuple[str, str], list[Finding]] = {}
    for finding in findings:
        if not finding.detail.startswith(STILL):
            groups.setdefault((finding.kind, _what(finding)), []).append(finding)
    found = _still(still, touch_s)
    for (kind, _), group in groups.items():
        found.append(MERGERS.get(kind, _first)(group))
    return found


def _what(finding: Finding) -> str:
    """Return a text without what differs from window to window."""
    if match := SATURATED.match(finding.detail):
        return match[1] + match[3]
    if finding.kind == 'mains_hum':
        return finding.detail.rsplit(':', 1)[-1]
    return finding.detail.split(' (')[0]


def _still(findings: Sequence[Finding], touch_s: float) -> list[Finding]:
    spans: list[Finding] = []
    for finding in sorted(findings, key=lambda f: f.from_s):
        if spans and finding.from_s <= spans[-1].to_s + touch_s:
            end = max(finding.to_s, spans[-1].to_s)
            text = f'{STILL} for {end - spans[-1].from_s:.2f} s'
            spans[-1] = replace(spans[-1], to_s=end, detail=text)
        else:
            spans.append(finding)
    return spans


def _first(group: Sequence[Finding]) -> Finding:
    return _over(group, group[0].detail)


def _saturated(group: Sequence[Finding]) -> Finding:
    """Sum the samples at the extreme value of all windows."""
    matches = [match for f in group if (match := SATURATED.match(f.detail))]
    best = (max if matches[0][3] == 'largest' else min)(float(m[4]) for m in matches)
    there = [
        (f, m) for f, m in zip(group, matches, strict=True) if abs(float(m[4]) - best) <= 1e-12
    ]
    n = sum(int(m[2]) for _, m in there)
    first = there[0][1]
    text = f'{first[1]}{n} samples at the {first[3]} value, {first[4]}'
    return _over([f for f, _ in there], text)


def _loudest(group: Sequence[Finding]) -> Finding:
    """Tell the tone of the window where it is strongest."""

    def amplitude(finding: Finding) -> float:
        match = re.match(r'a tone of (\S+)', finding.detail)
        return float(match[1]) if match else 0.0

    return _over(group, max(group, key=amplitude).detail)


MERGERS: dict[str, Callable[[Sequence[Finding]], Finding]] = {
    'saturation': _saturated,
    'mains_hum': _loudest,
}
