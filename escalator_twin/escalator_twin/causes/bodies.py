"""Change the numbers of a network of free bodies, one array at a time."""

from dataclasses import replace

from escalator_twin.causes.places import BOTH
from escalator_twin.physics.multibody.layout import Layout
from escalator_twin.physics.multibody.network import changed_in
from escalator_twin.signals import Floats

Where = int | slice


def share_of(side: str) -> float:
    """Return which part of a length that both sides have a change on ``side`` makes."""
    return 1.0 if side == BOTH else 0.5


def with_column(
    layout: Layout, name: str, where: Where, column: int, amount: float, factor: float = 1.0
) -> Layout:
    """Return a layout with ``factor * value + amount`` in one column of one of its arrays."""
    changed: Floats = getattr(layout.network, name).copy()
    changed[where, column] = factor * changed[where, column] + amount
    return replace(layout, network=changed_in(layout.network, **{name: changed}))


def chain_links(layout: Layout) -> slice:
    """Return where the chain's links are."""
    return slice(0, layout.steps.n if layout.steps else 0)
