"""Bring one topic's messages into the order of their stamps, saying what had to be mended."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from escalator_twin.bagfile.container import ALWAYS, Indices, Span
from escalator_twin.signals import Floats

# A stamp that departs by more than this from its neighbours is a step of the logger's clock, s:
# far above a recorder's latency, far below any reset of a clock.
CLOCK_STEP_S = 0.25
# Stamps further out than this many times the span of nine tenths of them, and than this many
# seconds, are not the logger's.
FAR_SPANS = 2.0
FAR_S = 60.0
# Samples on either side of a step whose clock readings are compared.
STEP_SPAN = 50
STEP_LEAST = 5
# Share of messages with another's stamp and other values above which the stamps tell no time.
MAX_REPEATED = 0.1


Remark = tuple[str, str, bool]


class Tidy(NamedTuple):
    """Messages in the order of their stamps, each stamp once.

    ``remarks`` holds (kind of finding, detail, repaired).
    """

    stamp_ns: Indices
    bag_ns: Indices
    fields: Floats
    remarks: list[Remark]


def tidy(
    stamp_ns: Indices | None,
    bag_ns: Indices,
    fields: Floats,
    span: Span = ALWAYS,
    origin_ns: int | None = None,
) -> Tidy:
    """Order the messages of one topic.

    Parameters
    ----------
    stamp_ns : (n,) int64 or None
        The logger's clock; ``None`` where the type has no header: then the bag's time.
    bag_ns : (n,) int64
        The recorder's clock.
    fields : (n, k) float64
        The messages' numbers.
    span : Span, optional
        What is kept and told of; messages outside are neighbours only.
    origin_ns : int, optional
        Bag time from which remarks count; the first message's by default.
    """
    remarks: list[Remark] = []
    by_bag = np.argsort(bag_ns, kind='stable')
    bag_ns, fields = bag_ns[by_bag], fields[by_bag]
    if stamp_ns is not None:
        stamp_ns = stamp_ns[by_bag]
        reason = _useless(stamp_ns, fields)
        if reason:
            remarks.append(('clock_disagreement', f'{reason}: the bag time is used', True))
            stamp_ns = None
    if stamp_ns is None:
        stamp_ns = bag_ns
    else:
        stamp_ns, steps = _without_steps(stamp_ns, bag_ns, span, origin_ns)
        remarks += [('clock_disagreement', step, True) for step in steps]
    is_near = _near(stamp_ns)
    if n_far := int((~is_near & span.holds(bag_ns)).sum()):
        text = f'{n_far} messages with stamps far from all others dropped'
        remarks.append(('clock_disagreement', text, True))
    stamp_ns, bag_ns, fields = stamp_ns[is_near], bag_ns[is_near], fields[is_near]
    is_behind = np.diff(stamp_ns) < 0
    if n_behind := int((is_behind & span.holds(bag_ns[1:])).sum()):
        text = f'{n_behind} messages behind a later one: sorted by stamp'
        remarks.append(('out_of_order', text, True))
    if is_behind.any():
        order = np.argsort(stamp_ns, kind='stable')
        stamp_ns, bag_ns, fields = stamp_ns[order], bag_ns[order], fields[order]
    is_kept, repeats = _first_of_each(stamp_ns, bag_ns, fields, span)
    is_kept &= span.holds(bag_ns)
    return Tidy(stamp_ns[is_kept], bag_ns[is_kept], fields[is_kept], remarks + repeats)


def _first_of_each(
    stamp_ns: Indices, bag_ns: Indices, fields: Floats, span: Span
) -> tuple[NDArray[np.bool_], list[Remark]]:
    """Tell which messages are the first of their stamp, and of the rest in words."""
    is_first = np.ones(len(stamp_ns), dtype=bool)
    is_first[1:] = np.diff(stamp_ns) != 0
    repeated = ~is_first[1:] & span.holds(bag_ns[1:])
    if not repeated.any():
        return is_first, []
    other = int((repeated & _differs(fields)).sum())
    text = f'{int(repeated.sum())} messages with the stamp of another dropped'
    if other:
        text += f', {other} of them with other values'
    return is_first, [('duplicate', text, True)]


def _differs(fields: Floats) -> NDArray[np.bool_]:
    """Tell of each message but the first whether it has other values than the one before."""
    before, after = fields[:-1], fields[1:]
    return ((before != after) & ~(np.isnan(before) & np.isnan(after))).any(axis=1)


def _useless(stamp_ns: Indices, fields: Floats) -> str:
    """Return why the stamps tell no time, '' where they do."""
    if len(stamp_ns) and not stamp_ns.any():
        return 'all header stamps are zero'
    if len(stamp_ns) < 10:
        return ''
    repeated = np.diff(stamp_ns) == 0
    share = float((repeated & _differs(fields)).mean())
    if share > MAX_REPEATED:
        return f'{100 * share:.0f} % of the header stamps repeat the one before'
    return ''


def _near(stamp_ns: Indices) -> NDArray[np.bool_]:
    """Tell which stamps lie within reach of the middle nine tenths; the rest are damaged."""
    low, high = np.quantile(stamp_ns, [0.05, 0.95])
    reach = FAR_SPANS * (high - low) + FAR_S * 1e9
    return np.asarray((stamp_ns > low - reach) & (stamp_ns < high + reach))


def _without_steps(
    stamp_ns: Indices, bag_ns: Indices, span: Span, origin_ns: int | None
) -> tuple[Indices, list[str]]:
    """Undo steps of the logger's clock, seen where its stamps jump and the bag time does not."""
    n = len(stamp_ns)
    if n < 3:
        return stamp_ns, []
    limit = int(CLOCK_STEP_S * 1e9)
    forward, arrival = np.diff(stamp_ns), np.diff(bag_ns)
    jumps = (np.abs(forward - np.median(forward)) > limit) & (arrival < limit)
    steps = []
    behind = stamp_ns - bag_ns
    for i in np.flatnonzero(jumps) + 1:
        if min(i, n - i) < STEP_LEAST:
            continue
        before = np.median(behind[max(0, i - STEP_SPAN) : i])
        after = np.median(behind[i : i + STEP_SPAN])
        size = float(after - before)
        if abs(size) < limit:
            continue
        # the step itself to the resolution of a period
        exact = int(forward[i - 1] - np.median(forward))
        stamp_ns = np.concatenate([stamp_ns[:i], stamp_ns[i:] - exact])
        behind = stamp_ns - bag_ns
        if not span.meets(int(bag_ns[i]), int(bag_ns[i])):
            continue
        seconds = (bag_ns[i] - (bag_ns[0] if origin_ns is None else origin_ns)) / 1e9
        steps.append(f"the logger's clock steps by {size / 1e9:+.3f} s at {seconds:.2f} s: undone")
    return stamp_ns, steps
