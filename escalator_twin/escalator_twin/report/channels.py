"""What a page knows of channels by their names: unit, group, and a handy scale."""

from collections.abc import Sequence

# Contracts.md gives the units of the channels; a document may carry its own as `unit`.
UNIT_OF_PART = {
    'acceleration': 'm/s²',
    'displacement': 'm',
    'link_force': 'N',
    'reaction': 'N',
    'speed': 'm/s',
    'tension': 'N',
    'torque': 'N m',
}
SCALES = ((1e3, 'k'), (1.0, ''), (1e-3, 'm'), (1e-6, 'µ'))
PREFIXED = ('N', 'm', 'N m', 'W', 'Pa')


def channel_unit(channel: str, told: str = '') -> str:
    """Return a channel's unit: as told by the document, else by the parts of its name."""
    if told:
        return told.replace('m/s2', 'm/s²').replace('m/s^2', 'm/s²')
    for part in reversed(channel.split('/')):
        if part in UNIT_OF_PART:
            return UNIT_OF_PART[part]
    return ''


def display_scale(largest: float, unit: str) -> tuple[float, str]:
    """Return by what values are divided for display, and the unit that is shown then."""
    if unit not in PREFIXED or not largest > 0.0:
        return 1.0, unit
    for scale, prefix in SCALES:
        if largest >= scale:
            return scale, prefix + unit
    return SCALES[-1][0], SCALES[-1][1] + unit


def group_of(channel: str) -> str:
    """Return the group by which several channels are averaged: what they measure."""
    parts = channel.split('/')
    return '/'.join(parts[:-1]) or channel


def union(lists: Sequence[Sequence[str]]) -> list[str]:
    """Return all names in the order of their first appearance."""
    return list(dict.fromkeys(name for names in lists for name in names))
