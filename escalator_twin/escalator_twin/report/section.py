"""What a section of the page is."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from escalator_twin.report.documents import Page

Context = dict[str, Any]


@dataclass(frozen=True)
class Section:
    """One part of the page: a template, and what is put in it.

    Attributes
    ----------
    name : str
        Anchor, and name of ``templates/<name>.html``.
    title : str
    context : callable
        Gets the page; returns the template's variables, ``None`` where there is nothing to tell.
    """

    name: str
    title: str
    context: Callable[[Page], Context | None]
